#ifndef HDTRAPEZE_RENDER_PARAM_H
#define HDTRAPEZE_RENDER_PARAM_H

#include "hdtrapeze.h"
#include "registry.h"

#include "pxr/base/gf/interval.h"
#include "pxr/base/tf/token.h"
#include "pxr/imaging/hd/changeTracker.h"
#include "pxr/imaging/hd/renderDelegate.h"
#include "pxr/imaging/hd/sceneDelegate.h"
#include "pxr/imaging/hd/sceneIndexObserver.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <atomic>
#include <exception>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <tuple>
#include <unordered_map>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

class HdRenderIndex;
class HdTrapezeInstancer;
class HdTrapezeRprim;

/// What the prims of one render delegate share: the renderer's session, the shutter that motion is
/// sampled for, and who there is. Functions may be called from any thread unless they say
/// otherwise.
class HdTrapezeRenderParam final : public HdRenderParam {
public:
    /// Null session where the library refuses; then nothing can be rendered.
    HdTrapezeRenderParam();
    ~HdTrapezeRenderParam() override;

    trz_session* Session() const { return _session; }

    /// Calls one of the C ABI's functions for the session. Whether it was a success; otherwise
    /// warns, naming the prim.
    template <class F, class... Arguments>
    bool Edit(SdfPath const& id, F function, Arguments... arguments) const {
        return _session && _IsDone(function(_session, arguments...), id);
    }

    /// A warning about a prim, or, with an empty path, about none.
    void Warn(SdfPath const& id, std::string const& text) const;

    /// The same, the first time only.
    void WarnOnce(SdfPath const& id, std::string const& text);

    /// Runs what asks the host for something: hosts throw where their scene is broken, which must
    /// not get out of a Sync. False then, and a warning.
    template <class F> bool Guard(SdfPath const& id, F&& ask) {
        try {
            ask();
            return true;
        } catch (std::exception const& error) {
            WarnOnce(id, std::string("the host cannot tell what it is: ") + error.what());
        } catch (...) {
            WarnOnce(id, "the host cannot tell what it is");
        }
        return false;
    }

    /// How far edits and renders are. A session that failed has nothing more to come.
    trz_progress Progress() const;

    // Motion -------------------------------------------------------------------------------------

    /// The interval that motion is sampled for, time codes relative to the frame. It holds 0, since
    /// velocities count from there, and the shutters of all cameras and settings.
    GfInterval Shutter() const;

    /// The shutter of a camera, of the host's settings or a RenderSettings prim; an empty one for
    /// none, as is one without ends. SampleShutter makes it count.
    void SetShutterOf(void const* owner, GfInterval const& shutter);

    /// Marks what moves where more is to be sampled than was and the host heeds it; true then. Not
    /// from Rprims' Sync. A smaller interval waits until something else is sampled anew.
    bool SampleShutter(HdRenderIndex& index);

    /// Which prims: those of scene delegates, whose samples are of a shutter that the host alone
    /// chooses; those of scene indices; or all.
    enum class Source { Delegates, SceneIndices, All };

    /// Has what may move synced again. True where there is any.
    bool MarkMotionDirty(HdRenderIndex& index, Source source) const;

    /// Has those of some prims synced again that come from there: what `bits` stand for, `locators`
    /// of scene indices. `mark` is the change tracker's function for such prims. True where there
    /// is any.
    using Mark = void (HdChangeTracker::*)(SdfPath const&, HdDirtyBits);
    bool MarkDirty(HdRenderIndex& index, SdfPathVector const& ids, Mark mark, HdDirtyBits bits,
                   HdDataSourceLocatorSet const& locators, Source source = Source::All) const;

    /// Says what hands on marks for prims of scene indices: the host's scene delegate, where it has
    /// any.
    void SetObserver(HdSceneDelegate* delegate) {
        _observer = dynamic_cast<HdSceneIndexObserver*>(delegate);
    }

    /// Whether a prim comes from a scene delegate, not from a scene index.
    static bool IsOfDelegate(HdRenderIndex const& index, SdfPath const& id);

    /// Whether there are prims of scene delegates.
    bool HasDelegates(HdRenderIndex const& index) const;

    /// Time codes a second, for velocities that there are. Says once where they are a guess.
    double TimeCodesPerSecond();

    /// Sets them, and whether the host or a user told them. True where they changed.
    bool SetTimeCodesPerSecond(double rate, bool isTold, HdRenderIndex& index);

    // Primvars -----------------------------------------------------------------------------------

    /// Primvars that AOVs show, beside those that shading needs. Marks prims where it grows; true
    /// then.
    bool WantPrimvars(std::set<TfToken> const& names, HdRenderIndex& index);
    std::set<TfToken> WantedPrimvars() const;

    // Prims --------------------------------------------------------------------------------------

    HdTrapezeRegistry<HdTrapezeRprim> prims;
    HdTrapezeRegistry<HdTrapezeInstancer> instancers;

    /// Has the instances of prototypes that were synced placed. Not during Sync.
    void CommitInstancers();

    /// Says that a prim's visibility, tag or place in collections may have changed.
    void MarkVisibilityDirty() { ++_visibilityVersion; }
    uint64_t VisibilityVersion() const { return _visibilityVersion; }

    /// What a render pass includes: roots, paths that are excluded, render tags.
    using Included = std::tuple<SdfPathVector, SdfPathVector, TfTokenVector>;

    /// Says what a render pass includes. Prims are hidden or shown for all passes: where two do not
    /// include the same, a warning says that the last one counts.
    void SetIncludedBy(void const* pass, Included const& included);
    void RemovePass(void const* pass);

private:
    bool _IsDone(trz_result result, SdfPath const& id) const;
    bool _MarkDirty(HdRenderIndex& index, HdDirtyBits bits, Source source) const;

    trz_session* _session = nullptr;
    std::atomic<HdSceneIndexObserver*> _observer{nullptr};
    std::atomic<uint64_t> _visibilityVersion{0};
    std::atomic<double> _timeCodesPerSecond{24.0};
    std::atomic<bool> _isRateTold{false};
    std::atomic<bool> _saidRate{false};

    mutable std::mutex _mutex;
    std::unordered_map<void const*, GfInterval> _shutters;
    GfInterval _shutter{0.0, 0.0};
    std::set<std::pair<SdfPath, std::string>> _warned;
    std::map<void const*, Included> _included;
    std::set<TfToken> _wanted;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
