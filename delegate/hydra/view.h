#ifndef HDTRAPEZE_VIEW_H
#define HDTRAPEZE_VIEW_H

#include "hdtrapeze.h"
#include "settings.h"

#include "pxr/imaging/cameraUtil/conformWindow.h"
#include "pxr/pxr.h"

#include <string>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

class HdTrapezeRenderParam;

/// What is rendered, besides the scene.
struct HdTrapezeView {
    trz_id camera = 0;
    trz_settings settings = {};
    std::vector<std::string> aovs;

    /// The same image, whatever AOVs of it.
    bool Agrees(HdTrapezeView const& other) const;
    bool operator==(HdTrapezeView const& other) const {
        return aovs == other.aovs && Agrees(other);
    }

    void AddAov(std::string const& name);

    /// Makes it what the session renders next.
    void Push(HdTrapezeRenderParam& param) const;
};

/// TRZ_WINDOW_* of a policy.
uint32_t HdTrapezeWindowPolicy(CameraUtilConformWindowPolicy policy);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
