#ifndef HDTRAPEZE_SYNCING_H
#define HDTRAPEZE_SYNCING_H

#include "renderParam.h"
#include "samples.h"

#include "pxr/imaging/hd/sceneDelegate.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// How the motion of a prim or an instancer is blurred.
struct HdTrapezeMotion {
    double blurScale = 1.0;
    /// Positions over the shutter where accelerations bend a path; 0: as many as needed.
    uint32_t sampleCount = 0;

    /// What is to be sampled of a shutter: all of it, and all of it scaled.
    GfInterval Reach(GfInterval const& shutter) const {
        return shutter * GfInterval(blurScale > 1.0 ? blurScale : 1.0);
    }
};

/// A prim, an instancer or a camera that is being synced: what it is, and where its description
/// comes from and goes to.
struct HdTrapezeSyncing {
    SdfPath const& id;
    trz_id prim;
    HdSceneDelegate* delegate;
    HdTrapezeRenderParam& param;
    /// What moves it is sampled for this interval.
    GfInterval shutter;
    /// Of geometry prims, Hydra's type.
    TfToken type = TfToken();

    /// Queues an edit; `function` is one of the C ABI's.
    template <class F, class... Arguments> bool Edit(F function, Arguments... arguments) const {
        return param.Edit(id, function, prim, arguments...);
    }

    /// The constant that a word stands for as the value of an attribute, USD's fallback where the
    /// word is empty. What is unknown gives a warning.
    uint32_t Word(char const* attribute, TfToken const& word) const;

    void SendTransform(HdTrapezeTransform const& samples) const;

    /// Pulls how motion is blurred, and sends it where it is not as known.
    void SendMotion(HdTrapezeMotion* known) const;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
