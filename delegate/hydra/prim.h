#ifndef HDTRAPEZE_PRIM_H
#define HDTRAPEZE_PRIM_H

#include "hdtrapeze.h"
#include "primvars.h"
#include "renderParam.h"

#include "pxr/base/vt/array.h"
#include "pxr/imaging/hd/rprim.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// How the motion of a prim or an instancer is blurred.
struct HdTrapezeMotion {
    double blurScale = 1.0;
    /// Positions over the shutter where accelerations bend a path; 0: as many as needed.
    uint32_t sampleCount = 0;

    HdTrapezeMotion() = default;
    HdTrapezeMotion(SdfPath const& id, HdSceneDelegate* delegate);

    bool operator!=(HdTrapezeMotion const& other) const {
        return blurScale != other.blurScale || sampleCount != other.sampleCount;
    }

    void Send(SdfPath const& id, trz_id prim, HdTrapezeRenderParam& param) const;
};

/// A geometry prim of the session, and what all kinds of Rprims have in common: place, motion,
/// points, primvars, instancing, visibility.
class HdTrapezePrim final {
public:
    using Create = trz_result (*)(trz_session*, char const* path, trz_id* out);

    /// Where a kind of Rprim has points, with velocities and accelerations.
    enum class Points { No, Yes };

    /// Without `create` there is nothing to render.
    HdTrapezePrim(Create create, Points points) : _create(create), _points(points) {}

    trz_id Id() const { return _id; }

    /// Pulls what is dirty. False where there is no prim to put it into: the library refused.
    bool Sync(HdRprim const& rprim, HdSceneDelegate* delegate, HdTrapezeRenderParam& param,
              HdDirtyBits bits);

    void Finalize(HdRprim const& rprim, HdTrapezeRenderParam& param);

    /// Shows the prim where it is visible and `included`, by render tags and the collection.
    void Include(SdfPath const& id, bool included, HdTrapezeRenderParam& param);

    TfToken const& RenderTag() const { return _renderTag; }
    void SetRenderTag(TfToken const& tag) { _renderTag = tag; }

    /// The interval that what moves this prim is sampled for: the shutter, scaled with its blur.
    GfInterval Shutter(HdTrapezeRenderParam const& param) const {
        return param.Shutter() * GfInterval(_reach);
    }

    /// Of each vertex, which of the points it is; none where points are in the vertices' order.
    VtIntArray const& Indices() const { return _indices; }
    void SetIndices(VtIntArray const& indices) { _indices = indices; }

    /// Hydra's refine level.
    int RefineLevel() const { return _refineLevel; }

private:
    void _SyncTransform(SdfPath const& id, HdSceneDelegate* delegate, HdTrapezeRenderParam& param);
    void _SyncPoints(SdfPath const& id, HdSceneDelegate* delegate, HdTrapezeRenderParam& param);
    void _SyncInstancer(HdRprim const& rprim, HdSceneDelegate* delegate,
                        HdTrapezeRenderParam& param);

    Create _create;
    Points _points;
    trz_id _id = 0;
    SdfPath _instancer;
    VtIntArray _indices;
    HdTrapezePrimvars _primvars;
    TfToken _renderTag;
    int _refineLevel = 0;
    double _reach = 1.0;
    bool _visible = true;
    // Its instancer is not there.
    bool _lost = false;
    bool _shown = true;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
