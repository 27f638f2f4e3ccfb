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
    /// Pulls those that shading, curves and points need and AOVs show; removes those that are no
    /// more. `indices` are HdTrapezePrim::Indices.
    void Sync(SdfPath const& id, trz_id prim, VtIntArray const& indices, HdSceneDelegate* delegate,
              HdTrapezeRenderParam& param);

    /// How many values of a primvar are one.
    static int ElementSize(HdPrimvarDescriptor const& primvar);

    /// Whether something besides AOVs needs a primvar.
    static bool IsNeeded(TfToken const& name);

private:
    std::set<TfToken> _sent;
};

/// Primvars of a prim with that interpolation, those that ext computations give too.
uint32_t HdTrapezeInterpolation(HdInterpolation interpolation);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
