#ifndef HDTRAPEZE_MESH_H
#define HDTRAPEZE_MESH_H

#include "rprim.h"

#include "pxr/imaging/hd/mesh.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// A polygon mesh or subdivision surface; always rendered as the latter's limit.
class HdTrapezeMesh final : public HdTrapezeRprim<HdMesh> {
public:
    explicit HdTrapezeMesh(SdfPath const& id)
        : HdTrapezeRprim(id, trz_mesh_create, HdTrapezePrim::Points::Yes) {}

private:
    void _SyncShape(HdTrapezePrim const& prim, HdSceneDelegate* delegate,
                    HdTrapezeRenderParam& param, HdDirtyBits bits) override;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
