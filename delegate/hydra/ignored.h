#ifndef HDTRAPEZE_IGNORED_H
#define HDTRAPEZE_IGNORED_H

#include "pxr/imaging/hd/changeTracker.h"
#include "pxr/imaging/hd/light.h"
#include "pxr/imaging/hd/material.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// A state that nothing is asked of but to be there.
template <class Base> class HdTrapezeIgnored final : public Base {
public:
    explicit HdTrapezeIgnored(SdfPath const& id) : Base(id) {}

    void Sync(HdSceneDelegate*, HdRenderParam*, HdDirtyBits* dirtyBits) override {
        *dirtyBits = HdChangeTracker::Clean;
    }
    HdDirtyBits GetInitialDirtyBitsMask() const override { return HdChangeTracker::Clean; }
};

/// A light. The renderer has one of its own, at the camera, which shines where the host has any:
/// most hosts put one there themselves where a scene has none.
using HdTrapezeLight = HdTrapezeIgnored<HdLight>;

/// A material. Surfaces have their displayColor; hosts warn of materials where a renderer does not
/// take them.
using HdTrapezeMaterial = HdTrapezeIgnored<HdMaterial>;

PXR_NAMESPACE_CLOSE_SCOPE

#endif
