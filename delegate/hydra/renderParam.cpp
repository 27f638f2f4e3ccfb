#include "renderParam.h"

#include "instancer.h"
#include "numbers.h"
#include "schema.h"

#include "pxr/base/tf/diagnostic.h"
#include "pxr/base/tf/stringUtils.h"
#include "pxr/imaging/hd/extComputationPrimvarsSchema.h"
#include "pxr/imaging/hd/primvarsSchema.h"
#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/sceneDelegate.h"
#include "pxr/imaging/hd/tokens.h"
#include "pxr/imaging/hd/xformSchema.h"

#include <cmath>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Messages go where Hydra's own go; TF_WARN and TF_STATUS may be used from any thread.
void _Log(void*, uint32_t level, char const* path, char const* code, char const* text) {
    std::string const at = *path ? TfStringPrintf(" <%s>", path) : "";
    std::string const kind = *code ? TfStringPrintf(" (%s)", code) : "";
    std::string const message = "Trapeze" + at + ": " + text + kind;
    switch (level) {
    case TRZ_LOG_ERROR:
        TF_RUNTIME_ERROR(message);
        break;
    case TRZ_LOG_WARN:
        TF_WARN(message);
        break;
    default:
        TF_STATUS(message);
    }
}

} // namespace

HdTrapezeRenderParam::HdTrapezeRenderParam() {
    if (trz_session_create(&_session) != TRZ_OK) {
        TF_RUNTIME_ERROR("Trapeze: %s", trz_last_error());
        _session = nullptr;
        return;
    }
    trz_session_set_log(_session, _Log, nullptr, TRZ_LOG_INFO);
}

HdTrapezeRenderParam::~HdTrapezeRenderParam() { trz_session_destroy(_session); }

bool HdTrapezeRenderParam::_IsDone(trz_result result, SdfPath const& id) const {
    // A poisoned session says so of every call; what poisoned it has told why.
    if (result != TRZ_OK && result != TRZ_ERROR_POISONED) {
        Warn(id, std::string(trz_last_error()) + " (" + trz_result_name(result) + ")");
    }
    return result == TRZ_OK;
}

void HdTrapezeRenderParam::Warn(SdfPath const& id, std::string const& text) const {
    _Log(nullptr, TRZ_LOG_WARN, id.GetText(), "", text.c_str());
}

void HdTrapezeRenderParam::WarnOnce(SdfPath const& id, std::string const& text) {
    {
        std::lock_guard<std::mutex> lock(_mutex);
        if (!_warned.emplace(id, text).second) {
            return;
        }
    }
    Warn(id, text);
}

trz_progress HdTrapezeRenderParam::Progress() const {
    auto progress = HdTrapezeStruct<trz_progress>();
    if (trz_render_progress(_session, &progress) != TRZ_OK) {
        progress.view_converged = progress.view_stopped = 1;
    }
    return progress;
}

GfInterval HdTrapezeRenderParam::Shutter() const {
    std::lock_guard<std::mutex> lock(_mutex);
    return _shutter;
}

void HdTrapezeRenderParam::SetShutterOf(void const* owner, GfInterval const& shutter) {
    std::lock_guard<std::mutex> lock(_mutex);
    if (shutter.IsEmpty() || !std::isfinite(shutter.GetSize())) {
        _shutters.erase(owner);
    } else {
        _shutters[owner] = shutter;
    }
}

bool HdTrapezeRenderParam::SampleShutter(HdRenderIndex& index) {
    {
        std::lock_guard<std::mutex> lock(_mutex);
        GfInterval shutter(0.0, 0.0);
        for (auto const& [owner, interval] : _shutters) {
            shutter |= interval;
        }
        if (_shutter.Contains(shutter)) {
            return false;
        }
        _shutter = shutter;
    }
    return MarkMotionDirty(index, Source::SceneIndices);
}

bool HdTrapezeRenderParam::IsOfDelegate(HdRenderIndex const& index, SdfPath const& id) {
    HdContainerDataSourceHandle const source = HdTrapezeFindSource(index, id);
    return !source || source->Get(HdSceneIndexEmulationTokens->sceneDelegate);
}

bool HdTrapezeRenderParam::HasDelegates(HdRenderIndex const& index) const {
    auto const all = prims.All();
    return !all.empty() && IsOfDelegate(index, all.begin()->first);
}

// Change trackers take marks for prims of scene delegates only. For those of scene indices it is
// their observer that is told, which hands them on to the render index.
bool HdTrapezeRenderParam::MarkDirty(HdRenderIndex& index, SdfPathVector const& ids, Mark mark,
                                     HdDirtyBits bits, HdDataSourceLocatorSet const& locators,
                                     Source source) const {
    HdSceneIndexObserver* const observer = _observer;
    HdSceneIndexObserver::DirtiedPrimEntries told;
    bool any = false;
    for (SdfPath const& id : ids) {
        bool const ofDelegate = IsOfDelegate(index, id);
        if (source == (ofDelegate ? Source::SceneIndices : Source::Delegates)) {
            continue;
        }
        any = true;
        if (!observer || ofDelegate) {
            (index.GetChangeTracker().*mark)(id, bits);
        } else {
            told.emplace_back(id, locators);
        }
    }
    if (!told.empty()) {
        observer->PrimsDirtied(*index.GetTerminalSceneIndex(), told);
    }
    return any;
}

bool HdTrapezeRenderParam::_MarkDirty(HdRenderIndex& index, HdDirtyBits bits, Source source) const {
    HdDataSourceLocatorSet const locators = {
        HdXformSchema::GetDefaultLocator(),
        HdPrimvarsSchema::GetDefaultLocator(),
        HdExtComputationPrimvarsSchema::GetDefaultLocator(),
    };
    auto const markAll = [&](auto const& all, Mark mark) {
        SdfPathVector ids;
        for (auto const& [id, one] : all) {
            ids.push_back(id);
        }
        return MarkDirty(index, ids, mark, bits, locators, source);
    };
    bool const any = markAll(prims.All(), &HdChangeTracker::MarkRprimDirty);
    return markAll(instancers.All(), &HdChangeTracker::MarkInstancerDirty) || any;
}

bool HdTrapezeRenderParam::MarkMotionDirty(HdRenderIndex& index, Source source) const {
    HdDirtyBits const bits = HdChangeTracker::DirtyTransform | HdChangeTracker::DirtyPoints |
                             HdChangeTracker::DirtyPrimvar;
    return _MarkDirty(index, bits, source);
}

bool HdTrapezeRenderParam::SetTimeCodesPerSecond(double rate, bool isTold, HdRenderIndex& index) {
    _isRateTold = isTold;
    if (!(rate > 0.0) || _timeCodesPerSecond.exchange(rate) == rate) {
        return false;
    }
    return MarkMotionDirty(index, Source::All);
}

double HdTrapezeRenderParam::TimeCodesPerSecond() {
    double const rate = _timeCodesPerSecond;
    if (!_isRateTold && !_saidRate.exchange(true)) {
        TF_STATUS("Trapeze: this host does not tell the stage's time codes a second; velocities "
                  "are resolved with %g, or what trapeze:timeCodesPerSecond says",
                  rate);
    }
    return rate;
}

bool HdTrapezeRenderParam::WantPrimvars(std::set<TfToken> const& names, HdRenderIndex& index) {
    {
        std::lock_guard<std::mutex> lock(_mutex);
        size_t const before = _wanted.size();
        _wanted.insert(names.begin(), names.end());
        if (_wanted.size() == before) {
            return false;
        }
    }
    return _MarkDirty(index, HdChangeTracker::DirtyPrimvar, Source::All);
}

std::set<TfToken> HdTrapezeRenderParam::WantedPrimvars() const {
    std::lock_guard<std::mutex> lock(_mutex);
    return _wanted;
}

void HdTrapezeRenderParam::SetIncludedBy(void const* pass, Included const& included) {
    bool differ = false;
    {
        std::lock_guard<std::mutex> lock(_mutex);
        _included[pass] = included;
        for (auto const& [other, theirs] : _included) {
            differ |= theirs != included;
        }
    }
    if (differ) {
        WarnOnce(SdfPath(), "render passes with different collections or render tags share one "
                            "scene; all show what the last one of them asks for");
    }
}

void HdTrapezeRenderParam::RemovePass(void const* pass) {
    std::lock_guard<std::mutex> lock(_mutex);
    _included.erase(pass);
}

void HdTrapezeRenderParam::CommitInstancers() {
    for (auto const& [id, instancer] : instancers.All()) {
        instancer->Commit(*this);
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
