#ifndef HDTRAPEZE_TOKENS_H
#define HDTRAPEZE_TOKENS_H

#include "pxr/base/tf/staticTokens.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// Keys of the render settings: of SetRenderSetting, and of a RenderSettings prim's attributes.
#define HDTRAPEZE_SETTINGS_TOKENS                                                                  \
    ((samples, "trapeze:samples"))((shadingRate, "trapeze:shadingRate"))(                          \
        (filter, "trapeze:filter"))((filterWidth, "trapeze:filterWidth"))(                         \
        (curves, "trapeze:curves"))((cull, "trapeze:cull"))((seed, "trapeze:seed"))(               \
        (threads, "trapeze:threads"))((backend, "trapeze:backend"))(                               \
        (cameraLight, "trapeze:cameraLight"))((overrideShutter, "trapeze:overrideShutter"))(       \
        (shutterOpen, "trapeze:shutterOpen"))((shutterClose, "trapeze:shutterClose"))(             \
        (shutter, "trapeze:shutter"))((disableMotionBlur, "trapeze:disableMotionBlur"))(           \
        (disableDepthOfField, "trapeze:disableDepthOfField"))(                                     \
        (maxMicropolygons, "trapeze:maxMicropolygons"))(                                           \
        (timeCodesPerSecond, "trapeze:timeCodesPerSecond"))((compression, "trapeze:compression"))( \
        (pixelType, "trapeze:pixelType"))

TF_DECLARE_PUBLIC_TOKENS(HdTrapezeSettingsTokens, HDTRAPEZE_SETTINGS_TOKENS);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
