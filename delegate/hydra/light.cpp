#include "light.h"

#include "renderParam.h"

PXR_NAMESPACE_OPEN_SCOPE

void HdTrapezeLight::Sync(HdSceneDelegate*, HdRenderParam* renderParam, HdDirtyBits* dirtyBits) {
    if (!_counted) {
        _counted = true;
        static_cast<HdTrapezeRenderParam*>(renderParam)->AddLight();
    }
    *dirtyBits = Clean;
}

void HdTrapezeLight::Finalize(HdRenderParam* renderParam) {
    if (_counted) {
        _counted = false;
        static_cast<HdTrapezeRenderParam*>(renderParam)->RemoveLight();
    }
    HdLight::Finalize(renderParam);
}

PXR_NAMESPACE_CLOSE_SCOPE
