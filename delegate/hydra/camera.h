#ifndef HDTRAPEZE_CAMERA_H
#define HDTRAPEZE_CAMERA_H

#include "hdtrapeze.h"

#include "pxr/base/gf/interval.h"
#include "pxr/imaging/hd/camera.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

class HdRenderIndex;
class HdTrapezeRenderParam;
struct HdTrapezeSyncing;

/// A camera, with the shutter that motion is sampled for.
class HdTrapezeCamera final : public HdCamera {
public:
    explicit HdTrapezeCamera(SdfPath const& id) : HdCamera(id) {}

    void Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam,
              HdDirtyBits* dirtyBits) override;
    void Finalize(HdRenderParam* renderParam) override;

    /// The session's camera; 0 before the first Sync.
    trz_id Id() const { return _id; }

    /// From open to close, at open where it closes before; no length where it is not finite, of
    /// which the renderer warns.
    GfInterval Shutter() const;

    /// What its motion was sampled for.
    GfInterval const& Sampled() const { return _sampled; }

    /// Has it synced again, for the shutter that is wanted now.
    void SampleAgain(HdRenderIndex& index, HdTrapezeRenderParam const& param) const;

private:
    void _Sync(HdSceneDelegate* delegate, HdTrapezeRenderParam& param, HdDirtyBits* dirtyBits);
    void _SendLens(HdTrapezeSyncing const& camera) const;

    trz_id _id = 0;
    GfInterval _sampled;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
