#ifndef HDTRAPEZE_NURBS_CURVES_H
#define HDTRAPEZE_NURBS_CURVES_H

#include "rprim.h"

#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// NURBS curves, as hosts with scene indices hand them on.
class HdTrapezeNurbsCurves final : public HdTrapezeRprim<HdTrapezePlainRprim> {
public:
    explicit HdTrapezeNurbsCurves(SdfPath const& id)
        : HdTrapezeRprim(id, trz_nurbs_curves_create, HdTrapezePrim::Points::Yes) {}

private:
    void _SyncShape(HdTrapezePrim const& prim, HdSceneDelegate* delegate,
                    HdTrapezeRenderParam& param, HdDirtyBits bits) override;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
