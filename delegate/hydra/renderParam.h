#ifndef HDTRAPEZE_RENDER_PARAM_H
#define HDTRAPEZE_RENDER_PARAM_H

#include "hdtrapeze.h"

#include "pxr/base/gf/interval.h"
#include "pxr/base/tf/token.h"
#include "pxr/imaging/hd/changeTracker.h"
#include "pxr/imaging/hd/renderDelegate.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <atomic>
#include <map>
#include <mutex>
#include <set>
#include <unordered_map>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

class HdTrapezeCamera;
class HdTrapezeInstancer;
class HdTrapezePrim;

/// What the prims of one render delegate share: the renderer's session, the shutter that motion is
/// sampled for, and who there is. Functions may be called from any thread unless they say
/// otherwise.
class HdTrapezeRenderParam final : public HdRenderParam {
public:
    /// Null session where the library refuses; then nothing can be rendered.
    HdTrapezeRenderParam();
    ~HdTrapezeRenderParam() override;

    trz_session* Session() const { return _session; }

    /// Counts an edit where the call was a success; otherwise warns, naming the prim.
    bool Edit(trz_result result, SdfPath const& id);

    /// Edits so far: where it has grown, there is something to render anew.
    uint64_t Edits() const { return _edits; }

    // Motion -------------------------------------------------------------------------------------

    /// The interval that motion is sampled for, time codes relative to the frame. It holds 0, since
    /// velocities count from there, and the shutters of all cameras.
    GfInterval Shutter() const;

    /// The shutter that settings ask for, in place of those of cameras; an empty one for none.
    /// Marks what moves where this changes what is to be sampled. Not from Rprims' Sync.
    void SetShutterOverride(GfInterval const& shutter, HdChangeTracker& tracker);

    /// A camera's shutter, as SetShutterOverride.
    void SetCameraShutter(HdTrapezeCamera const* camera, GfInterval const& shutter,
                          HdChangeTracker& tracker);
    void RemoveCamera(HdTrapezeCamera const* camera);

    /// Has everything that may move synced again.
    void MarkMotionDirty(HdChangeTracker& tracker) const;

    double TimeCodesPerSecond() const { return _timeCodesPerSecond; }
    void SetTimeCodesPerSecond(double rate, HdChangeTracker& tracker);

    // Primvars -----------------------------------------------------------------------------------

    /// Primvars that AOVs show, beside those that shading needs. Marks prims where it grows.
    void WantPrimvars(std::set<TfToken> const& names, HdChangeTracker& tracker);
    std::set<TfToken> WantedPrimvars() const;

    // Prims --------------------------------------------------------------------------------------

    void AddPrim(SdfPath const& id, HdTrapezePrim* prim);
    void RemovePrim(SdfPath const& id);
    void AddInstancer(SdfPath const& id, HdTrapezeInstancer* instancer);
    void RemoveInstancer(SdfPath const& id);
    HdTrapezeInstancer* FindInstancer(SdfPath const& id) const;

    /// Calls f(path, prim) for every geometry prim, in the order of paths. Not during Sync.
    template <class F> void ForEachPrim(F&& f) const {
        std::lock_guard<std::mutex> lock(_mutex);
        for (auto const& [id, prim] : _prims) {
            f(id, *prim);
        }
    }

    /// Has the instances of prototypes that were synced placed. Not during Sync.
    void CommitInstancers();

    /// Says that a prim's visibility, tag or place in collections may have changed.
    void MarkVisibilityDirty() { ++_visibilityVersion; }
    uint64_t VisibilityVersion() const { return _visibilityVersion; }

    // Lights -------------------------------------------------------------------------------------

    /// Lights that the host has: those of the scene, and the one that it puts at the camera.
    void AddLight() { ++_lights; }
    void RemoveLight() { --_lights; }
    bool HasLights() const { return _lights > 0; }

private:
    GfInterval _ComputeShutter() const;
    bool _GrowShutter();

    trz_session* _session = nullptr;
    std::atomic<uint64_t> _edits{0};
    std::atomic<uint64_t> _visibilityVersion{0};
    std::atomic<int> _lights{0};
    std::atomic<double> _timeCodesPerSecond{24.0};

    mutable std::mutex _mutex;
    GfInterval _override;
    std::unordered_map<HdTrapezeCamera const*, GfInterval> _cameras;
    GfInterval _shutter{0.0, 0.0};
    std::set<TfToken> _wanted;
    std::map<SdfPath, HdTrapezePrim*> _prims;
    std::map<SdfPath, HdTrapezeInstancer*> _instancers;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
