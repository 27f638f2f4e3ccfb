#ifndef HDTRAPEZE_MATERIAL_H
#define HDTRAPEZE_MATERIAL_H

#include "pxr/imaging/hd/material.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// A material that nothing is asked of: surfaces have their displayColor. Hosts warn of materials
/// where a renderer does not take them.
class HdTrapezeMaterial final : public HdMaterial {
public:
    explicit HdTrapezeMaterial(SdfPath const& id) : HdMaterial(id) {}

    void Sync(HdSceneDelegate*, HdRenderParam*, HdDirtyBits* dirtyBits) override {
        *dirtyBits = Clean;
    }
    HdDirtyBits GetInitialDirtyBitsMask() const override { return Clean; }
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
