#ifndef HDTRAPEZE_PRIMVARS_H
#define HDTRAPEZE_PRIMVARS_H

#include "hdtrapeze.h"
#include "renderParam.h"

#include "pxr/base/vt/array.h"
#include "pxr/imaging/hd/sceneDelegate.h"
#include "pxr/pxr.h"

#include <set>

PXR_NAMESPACE_OPEN_SCOPE

/// The primvars of one prim or instancer that the session has.
class HdTrapezePrimvars final {
public:
    /// What they belong to: a prim and its parts, or the instances of an instancer.
    enum class Of { Prim, Instances };

    /// Pulls those that shading, curves and points need and AOVs show; removes those that are no
    /// more. `indices` are HdTrapezePrim::Indices.
    void Sync(Of of, SdfPath const& id, trz_id prim, VtIntArray const& indices,
              HdSceneDelegate* delegate, HdTrapezeRenderParam& param);

private:
    std::set<TfToken> _sent;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
