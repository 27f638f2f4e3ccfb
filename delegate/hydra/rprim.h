#ifndef HDTRAPEZE_RPRIM_H
#define HDTRAPEZE_RPRIM_H

#include "primvars.h"
#include "shapes.h"

#include "pxr/base/vt/array.h"
#include "pxr/imaging/hd/rprim.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// A geometry prim. What all kinds have in common is here: place, motion, points, primvars,
/// instancing, visibility; what one kind alone has is its shape's.
class HdTrapezeRprim final : public HdRprim {
public:
    HdTrapezeRprim(SdfPath const& id, HdTrapezeShape const& shape) : HdRprim(id), _shape(shape) {}

    void Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam, HdDirtyBits* dirtyBits,
              TfToken const&) override;
    void UpdateRenderTag(HdSceneDelegate* delegate, HdRenderParam* renderParam) override;
    void Finalize(HdRenderParam* renderParam) override;
    HdDirtyBits GetInitialDirtyBitsMask() const override;
    TfTokenVector const& GetBuiltinPrimvarNames() const override;

    /// Shows the prim where it is visible and `included`, by render tags and the collection.
    void Include(bool included, HdTrapezeRenderParam& param);

    /// Hydra's refine level.
    int RefineLevel() const { return _refineLevel; }

protected:
    HdDirtyBits _PropagateDirtyBits(HdDirtyBits bits) const override { return bits; }
    void _InitRepr(TfToken const& name, HdDirtyBits*) override;

private:
    void _Sync(HdSceneDelegate* delegate, HdTrapezeRenderParam& param, HdDirtyBits bits);
    void _SyncTransform(HdTrapezeSyncing const& prim);
    bool _SyncIndices(HdTrapezeSyncing const& prim);
    void _SyncPoints(HdTrapezeSyncing const& prim);
    void _SyncInstancer(HdTrapezeSyncing const& prim);

    HdTrapezeShape const& _shape;
    // 0 before the first Sync, and where the session refused it.
    trz_id _id = 0;
    SdfPath _instancer;
    // Of each vertex, which of the points it is; none where points are in the vertices' order.
    VtIntArray _indices;
    HdTrapezePrimvars _primvars;
    int _refineLevel = 0;
    HdTrapezeMotion _motion;
    // It is not drawn: its instancer is not there, or the host could not tell what it is.
    bool _lost = false;
    bool _shown = true;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
