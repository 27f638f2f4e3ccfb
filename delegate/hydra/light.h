#ifndef HDTRAPEZE_LIGHT_H
#define HDTRAPEZE_LIGHT_H

#include "pxr/imaging/hd/light.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// A light. The renderer has one of its own, at the camera, which shines where the host has any:
/// most hosts put one there themselves where a scene has none.
class HdTrapezeLight final : public HdLight {
public:
    HdTrapezeLight(SdfPath const& id, TfToken const& type) : HdLight(id), _type(type) {}

    void Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam,
              HdDirtyBits* dirtyBits) override;
    void Finalize(HdRenderParam* renderParam) override;
    HdDirtyBits GetInitialDirtyBitsMask() const override { return AllDirty; }

private:
    TfToken _type;
    bool _counted = false;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
