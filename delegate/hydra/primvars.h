#ifndef HDTRAPEZE_PRIMVARS_H
#define HDTRAPEZE_PRIMVARS_H

#include "hdtrapeze.h"
#include "renderParam.h"

#include "pxr/imaging/hd/sceneDelegate.h"
#include "pxr/pxr.h"

#include <set>

PXR_NAMESPACE_OPEN_SCOPE

/// The primvars of one prim or instancer that the session has.
class HdTrapezePrimvars final {
public:
    /// Pulls those that shading, curves and points need and AOVs show; removes those that are no
    /// more.
    void Sync(SdfPath const& id, trz_id prim, HdSceneDelegate* delegate,
              HdTrapezeRenderParam& param);

    /// Whether something besides AOVs needs a primvar.
    static bool IsNeeded(TfToken const& name);

private:
    std::set<TfToken> _sent;
};

/// Primvars of a prim with that interpolation, those that ext computations give too.
uint32_t HdTrapezeInterpolation(HdInterpolation interpolation);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
