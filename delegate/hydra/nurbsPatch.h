#ifndef HDTRAPEZE_NURBS_PATCH_H
#define HDTRAPEZE_NURBS_PATCH_H

#include "rprim.h"

#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// A NURBS patch, as hosts with scene indices hand them on; untrimmed.
class HdTrapezeNurbsPatch final : public HdTrapezeRprim<HdTrapezePlainRprim> {
public:
    explicit HdTrapezeNurbsPatch(SdfPath const& id)
        : HdTrapezeRprim(id, trz_nurbs_patch_create, HdTrapezePrim::Points::Yes) {}

private:
    void _SyncShape(HdTrapezePrim const& prim, HdSceneDelegate* delegate,
                    HdTrapezeRenderParam& param, HdDirtyBits bits) override;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
