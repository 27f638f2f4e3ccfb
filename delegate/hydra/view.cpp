#include "view.h"

#include "renderParam.h"

#include <algorithm>
#include <cstring>

PXR_NAMESPACE_OPEN_SCOPE

bool HdTrapezeView::Agrees(HdTrapezeView const& other) const {
    // Settings come from trz_settings_default each time, so that their padding is the same.
    return camera == other.camera && std::memcmp(&settings, &other.settings, sizeof(settings)) == 0;
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
