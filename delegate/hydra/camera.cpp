#include "camera.h"

#include "numbers.h"
#include "renderParam.h"
#include "samples.h"

#include "pxr/imaging/hd/cameraSchema.h"
#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/sceneDelegate.h"
#include "pxr/imaging/hd/xformSchema.h"

#include <cmath>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

TF_DEFINE_PRIVATE_TOKENS(_tokens, (linearExposureScale));

double _Number(VtValue const& value, double fallback) {
    VtValue const number = VtValue::Cast<double>(value);
    return number.IsHolding<double>() ? number.UncheckedGet<double>() : fallback;
}

// Hydra's cameras have an exposure in stops; newer ones a factor that stands for all of it.
double _ExposureScale(HdSceneDelegate* delegate, SdfPath const& id, HdCamera const& camera) {
    VtValue const scale = delegate->GetCameraParamValue(id, _tokens->linearExposureScale);
    return _Number(scale, std::exp2(static_cast<double>(camera.GetExposure())));
}

// One number of the lens that changes. Scene delegates of the older kind give samples in the units
// of USD's attributes, tenths of Hydra's: the value that Hydra has tells.
struct _Track : HdTrapezeSamples<double> {
    _Track(HdSceneDelegate* delegate, SdfPath const& id, TfToken const& name, double now,
           GfInterval const& shutter) {
        auto const samples = HdTrapezeSamplePrimvar(delegate, id, name, shutter);
        for (size_t i = 0; i < samples.values.size(); ++i) {
            VtValue const value = VtValue::Cast<double>(samples.values[i]);
            if (value.IsHolding<double>()) {
                times.push_back(samples.times[i]);
                values.push_back(value.UncheckedGet<double>());
            }
        }
        if (times.size() < 2) {
            times.clear();
            values.clear();
            return;
        }
        double const given = At(0.0, now);
        if (std::abs(0.1 * given - now) < std::abs(given - now)) {
            for (double& value : values) {
                value *= 0.1;
            }
        }
    }

    double At(double time, double now) const { return HdTrapezeAt(*this, time, now); }
};

// The lens at every instant at which one of its numbers has a sample; none where it stays as it is.
std::vector<trz_lens_sample> _LensSamples(HdSceneDelegate* delegate, SdfPath const& id,
                                          trz_camera const& camera, GfInterval const& shutter) {
    struct _Number {
        TfToken const& name;
        double trz_camera::* now;
        double trz_lens_sample::* at;
    };
    auto const& t = *HdCameraTokens;
    _Number const numbers[] = {
        {t.horizontalAperture, &trz_camera::horizontal_aperture,
         &trz_lens_sample::horizontal_aperture},
        {t.verticalAperture, &trz_camera::vertical_aperture, &trz_lens_sample::vertical_aperture},
        {t.horizontalApertureOffset, &trz_camera::horizontal_aperture_offset,
         &trz_lens_sample::horizontal_aperture_offset},
        {t.verticalApertureOffset, &trz_camera::vertical_aperture_offset,
         &trz_lens_sample::vertical_aperture_offset},
        {t.focalLength, &trz_camera::focal_length, &trz_lens_sample::focal_length},
        {t.focusDistance, &trz_camera::focus_distance, &trz_lens_sample::focus_distance},
        {t.fStop, &trz_camera::f_stop, &trz_lens_sample::f_stop},
    };
    std::vector<_Track> tracks;
    std::set<double> times;
    for (_Number const& number : numbers) {
        tracks.emplace_back(delegate, id, number.name, camera.*number.now, shutter);
        times.insert(tracks.back().times.begin(), tracks.back().times.end());
    }
    std::vector<trz_lens_sample> samples;
    for (double time : times) {
        trz_lens_sample sample = {};
        sample.time = time;
        sample.exposure_scale = camera.exposure_scale;
        for (size_t i = 0; i < tracks.size(); ++i) {
            sample.*numbers[i].at = tracks[i].At(time, camera.*numbers[i].now);
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
    SdfPath const& id = GetId();
    HdDirtyBits const bits = *dirtyBits;
    HdCamera::Sync(delegate, renderParam, dirtyBits);
    if (!param.Session()) {
        return;
    }
    _observer = dynamic_cast<HdSceneIndexObserver*>(delegate);
    bool const created = _id == 0;
    if (created && !param.Edit(trz_camera_create(param.Session(), id.GetText(), &_id), id)) {
        return;
    }
    if (created || (bits & DirtyParams)) {
        param.SetShutterOf(this, Shutter());
        param.SampleShutter(delegate->GetRenderIndex());
    }
    if (created || (bits & (DirtyTransform | DirtyParams))) {
        _sampled = param.Shutter();
        param.SetTransform(_id, HdTrapezeSampleTransform(delegate, id, param.Shutter()), id);
    }
    if (created || (bits & (DirtyParams | DirtyClipPlanes))) {
        trz_camera desc = {};
        desc.struct_size = sizeof(desc);
        trz_camera_default(&desc);
        desc.projection = GetProjection() == Orthographic ? TRZ_PROJECTION_ORTHOGRAPHIC
                                                          : TRZ_PROJECTION_PERSPECTIVE;
        desc.horizontal_aperture = GetHorizontalAperture();
        desc.vertical_aperture = GetVerticalAperture();
        desc.horizontal_aperture_offset = GetHorizontalApertureOffset();
        desc.vertical_aperture_offset = GetVerticalApertureOffset();
        desc.focal_length = GetFocalLength();
        desc.focus_distance = GetFocusDistance();
        desc.f_stop = GetFStop();
        desc.clipping_near = GetClippingRange().GetMin();
        desc.clipping_far = GetClippingRange().GetMax();
        desc.shutter_open = GetShutterOpen();
        desc.shutter_close = GetShutterClose();
        desc.exposure_scale = _ExposureScale(delegate, id, *this);
        std::vector<double> planes;
        for (GfVec4d const& plane : GetClipPlanes()) {
            planes.insert(planes.end(), plane.data(), plane.data() + 4);
        }
        desc.clipping_planes = planes.data();
        desc.clipping_plane_count = planes.size() / 4;
        auto const lens = _LensSamples(delegate, id, desc, param.Shutter());
        desc.lens_samples = lens.data();
        desc.lens_sample_count = lens.size();
        param.Edit(trz_camera_set(param.Session(), _id, &desc), id);
    }
}

// As HdTrapezeRenderParam marks prims: those of scene indices by their observer.
void HdTrapezeCamera::SampleAgain(HdRenderIndex& index) const {
    if (_observer && !HdTrapezeRenderParam::IsOfDelegate(index, GetId())) {
        HdDataSourceLocatorSet const locators = {HdXformSchema::GetDefaultLocator(),
                                                 HdCameraSchema::GetDefaultLocator()};
        _observer->PrimsDirtied(*index.GetTerminalSceneIndex(), {{GetId(), locators}});
    } else {
        index.GetChangeTracker().MarkSprimDirty(GetId(), DirtyTransform | DirtyParams);
    }
}

void HdTrapezeCamera::Finalize(HdRenderParam* renderParam) {
    auto& param = *static_cast<HdTrapezeRenderParam*>(renderParam);
    param.SetShutterOf(this, GfInterval());
    if (_id != 0) {
        param.Edit(trz_prim_remove(param.Session(), _id), GetId());
        _id = 0;
    }
    HdCamera::Finalize(renderParam);
}

PXR_NAMESPACE_CLOSE_SCOPE
