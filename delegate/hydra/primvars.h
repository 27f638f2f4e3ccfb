#ifndef HDTRAPEZE_PRIMVARS_H
#define HDTRAPEZE_PRIMVARS_H

#include "syncing.h"

#include "pxr/base/vt/array.h"
#include "pxr/pxr.h"

#include <set>

PXR_NAMESPACE_OPEN_SCOPE

/// The primvars of one prim or instancer that the session has.
class HdTrapezePrimvars final {
public:
    /// What they belong to: a prim and its parts, or the instances of an instancer.
    enum class Of { Prim, Instances };

    /// Pulls those that shading, curves and points need and AOVs show; removes those that are no
    /// more. `indices` are which of the points each vertex is; none where they are in order.
    void Sync(HdTrapezeSyncing const& prim, Of of, VtIntArray const& indices = {});

private:
    std::set<TfToken> _sent;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
