#include "camera.h"

#include "numbers.h"
#include "syncing.h"

#include "pxr/imaging/hd/cameraSchema.h"
#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/xformSchema.h"

#include <cmath>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

TF_DEFINE_PRIVATE_TOKENS(_tokens, (linearExposureScale));

// A number of the lens, which may change.
struct _Number {
    TfToken const& name;
    float (HdCamera::*get)() const;
    double trz_camera::* now;
    double trz_lens_sample::* at;
};

std::vector<_Number> const& _Numbers() {
    auto const& t = *HdCameraTokens;
    static std::vector<_Number> const numbers = {
        {t.horizontalAperture, &HdCamera::GetHorizontalAperture, &trz_camera::horizontal_aperture,
         &trz_lens_sample::horizontal_aperture},
        {t.verticalAperture, &HdCamera::GetVerticalAperture, &trz_camera::vertical_aperture,
         &trz_lens_sample::vertical_aperture},
        {t.horizontalApertureOffset, &HdCamera::GetHorizontalApertureOffset,
         &trz_camera::horizontal_aperture_offset, &trz_lens_sample::horizontal_aperture_offset},
        {t.verticalApertureOffset, &HdCamera::GetVerticalApertureOffset,
         &trz_camera::vertical_aperture_offset, &trz_lens_sample::vertical_aperture_offset},
        {t.focalLength, &HdCamera::GetFocalLength, &trz_camera::focal_length,
         &trz_lens_sample::focal_length},
        {t.focusDistance, &HdCamera::GetFocusDistance, &trz_camera::focus_distance,
         &trz_lens_sample::focus_distance},
        {t.fStop, &HdCamera::GetFStop, &trz_camera::f_stop, &trz_lens_sample::f_stop},
    };
    return numbers;
}

// Samples of one number. Scene delegates of the older kind give them in the units of USD's
// attributes, tenths of Hydra's: the value that Hydra has tells.
HdTrapezeSamples<double> _Sample(HdTrapezeSyncing const& camera, TfToken const& name, double now) {
    auto samples = HdTrapezeCast<double>(
        HdTrapezeSamplePrimvar(camera.delegate, camera.id, name, camera.shutter));
    double const given = HdTrapezeAt(samples, 0.0, now);
    if (std::abs(0.1 * given - now) < std::abs(given - now)) {
        for (double& value : samples.values) {
            value *= 0.1;
        }
    }
    return samples;
}

// The lens at every instant at which one of its numbers has a sample; none where it stays as it is.
std::vector<trz_lens_sample> _LensSamples(HdTrapezeSyncing const& camera, trz_camera const& desc) {
    std::vector<HdTrapezeSamples<double>> tracks;
    for (_Number const& number : _Numbers()) {
        tracks.push_back(_Sample(camera, number.name, desc.*number.now));
    }
    std::vector<trz_lens_sample> samples;
    for (double time : HdTrapezeTimes(tracks)) {
        trz_lens_sample sample = {};
        sample.time = time;
        sample.exposure_scale = desc.exposure_scale;
        for (size_t i = 0; i < tracks.size(); ++i) {
            auto const& [name, get, now, at] = _Numbers()[i];
            sample.*at =
                tracks[i].times.size() > 1 ? HdTrapezeAt(tracks[i], time, desc.*now) : desc.*now;
        }
        samples.push_back(sample);
    }
    return samples;
}

} // namespace

GfInterval HdTrapezeCamera::Shutter() const {
    double const open = GetShutterOpen();
    double const close = GetShutterClose();
    return std::isfinite(open) && std::isfinite(close) ? GfInterval(open, std::max(open, close))
                                                       : GfInterval(0.0, 0.0);
}

void HdTrapezeCamera::Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam,
                           HdDirtyBits* dirtyBits) {
    auto& param = *static_cast<HdTrapezeRenderParam*>(renderParam);
    param.Guard(GetId(), [&] { _Sync(delegate, param, dirtyBits); });
    *dirtyBits = Clean;
}

void HdTrapezeCamera::_Sync(HdSceneDelegate* delegate, HdTrapezeRenderParam& param,
                            HdDirtyBits* dirtyBits) {
    SdfPath const& id = GetId();
    HdDirtyBits bits = *dirtyBits;
    HdCamera::Sync(delegate, &param, dirtyBits);
    param.SetObserver(delegate);
    if (_id == 0) {
        if (!param.Edit(id, trz_camera_create, id.GetText(), &_id)) {
            return;
        }
        bits = AllDirty;
    }
    if (bits & DirtyParams) {
        param.SetShutterOf(this, Shutter());
        param.SampleShutter(delegate->GetRenderIndex());
    }
    HdTrapezeSyncing const camera{id, _id, delegate, param, param.Shutter()};
    if (bits & (DirtyTransform | DirtyParams)) {
        _sampled = camera.shutter;
        camera.SendTransform(HdTrapezeSampleTransform(delegate, id, camera.shutter));
    }
    if (bits & (DirtyParams | DirtyClipPlanes)) {
        _SendLens(camera);
    }
}

void HdTrapezeCamera::_SendLens(HdTrapezeSyncing const& camera) const {
    auto desc = HdTrapezeStruct<trz_camera>();
    trz_camera_default(&desc);
    desc.projection =
        GetProjection() == Orthographic ? TRZ_PROJECTION_ORTHOGRAPHIC : TRZ_PROJECTION_PERSPECTIVE;
    for (_Number const& number : _Numbers()) {
        desc.*number.now = (this->*number.get)();
    }
    desc.clipping_near = GetClippingRange().GetMin();
    desc.clipping_far = GetClippingRange().GetMax();
    desc.shutter_open = GetShutterOpen();
    desc.shutter_close = GetShutterClose();
    // Hydra's cameras have an exposure in stops; newer ones a factor that stands for all of it.
    desc.exposure_scale = VtValue::Cast<double>(camera.delegate->GetCameraParamValue(
                                                    camera.id, _tokens->linearExposureScale))
                              .GetWithDefault(std::exp2(static_cast<double>(GetExposure())));
    std::vector<double> planes;
    for (GfVec4d const& plane : GetClipPlanes()) {
        planes.insert(planes.end(), plane.data(), plane.data() + 4);
    }
    desc.clipping_planes = planes.data();
    desc.clipping_plane_count = planes.size() / 4;
    auto const lens = _LensSamples(camera, desc);
    desc.lens_samples = lens.data();
    desc.lens_sample_count = lens.size();
    camera.Edit(trz_camera_set, &desc);
}

void HdTrapezeCamera::SampleAgain(HdRenderIndex& index, HdTrapezeRenderParam const& param) const {
    param.MarkDirty(index, {GetId()}, &HdChangeTracker::MarkSprimDirty,
                    DirtyTransform | DirtyParams,
                    {HdXformSchema::GetDefaultLocator(), HdCameraSchema::GetDefaultLocator()});
}

void HdTrapezeCamera::Finalize(HdRenderParam* renderParam) {
    auto& param = *static_cast<HdTrapezeRenderParam*>(renderParam);
    param.SetShutterOf(this, GfInterval());
    if (_id != 0) {
        param.Edit(GetId(), trz_prim_remove, _id);
        _id = 0;
    }
    HdCamera::Finalize(renderParam);
}

PXR_NAMESPACE_CLOSE_SCOPE
