#include "view.h"

#include "renderParam.h"

#include <algorithm>
#include <tuple>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// All that this plugin sets. Bytes cannot be compared: what lies between fields may be anything.
auto _Fields(trz_settings const& s) {
    auto const& w = s.data_window;
    return std::tie(s.width, s.height, w[0], w[1], w[2], w[3], s.pixel_aspect, s.window_policy,
                    s.samples, s.shading_rate, s.filter, s.filter_width, s.seed, s.threads,
                    s.override_shutter, s.shutter_open, s.shutter_close, s.disable_motion_blur,
                    s.disable_defocus, s.camera_light, s.max_micropolygons, s.backend, s.curves,
                    s.keep_finer, s.cull, s.occlusion_culling);
}

} // namespace

bool HdTrapezeView::Agrees(HdTrapezeView const& other) const {
    return camera == other.camera && _Fields(settings) == _Fields(other.settings);
}

void HdTrapezeView::AddAov(std::string const& name) {
    if (std::find(aovs.begin(), aovs.end(), name) == aovs.end()) {
        aovs.push_back(name);
    }
}

void HdTrapezeView::Push(HdTrapezeRenderParam& param) const {
    trz_session* const session = param.Session();
    SdfPath const none;
    trz_settings used = settings;
    if (trz_session_set_settings(session, &used) == TRZ_ERROR_UNSUPPORTED) {
        param.WarnOnce(none, std::string(trz_last_error()) + "; the backend auto is used");
        used.backend = TRZ_BACKEND_AUTO;
    }
    param.Check(trz_session_set_settings(session, &used), none);
    param.Check(trz_session_set_active_camera(session, camera), none);
    std::vector<char const*> names;
    for (std::string const& name : aovs) {
        names.push_back(name.c_str());
    }
    param.Check(trz_session_set_aovs(session, names.data(), names.size()), none);
}

uint32_t HdTrapezeWindowPolicy(CameraUtilConformWindowPolicy policy) {
    switch (policy) {
    case CameraUtilMatchHorizontally:
        return TRZ_WINDOW_MATCH_HORIZONTALLY;
    case CameraUtilMatchVertically:
        return TRZ_WINDOW_MATCH_VERTICALLY;
    case CameraUtilFit:
        return TRZ_WINDOW_FIT;
    case CameraUtilCrop:
        return TRZ_WINDOW_CROP;
    default:
        return TRZ_WINDOW_DONT_CONFORM;
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
