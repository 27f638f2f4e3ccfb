#include "renderParam.h"

#include "instancer.h"

#include "pxr/base/tf/diagnostic.h"
#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/imaging/hd/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Messages go where Hydra's own go; TF_WARN and TF_STATUS may be used from any thread.
void _Log(void*, uint32_t level, char const* path, char const* code, char const* text) {
    char const* const at = *path ? " <" : "";
    char const* const end = *path ? ">" : "";
    char const* const kind = *code ? code : "message";
    switch (level) {
    case TRZ_LOG_ERROR:
        TF_RUNTIME_ERROR("Trapeze%s%s%s: %s (%s)", at, path, end, text, kind);
        break;
    case TRZ_LOG_WARN:
        TF_WARN("Trapeze%s%s%s: %s (%s)", at, path, end, text, kind);
        break;
    default:
        TF_STATUS("Trapeze%s%s%s: %s", at, path, end, text);
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

bool HdTrapezeRenderParam::Edit(trz_result result, SdfPath const& id) {
    bool const done = Check(result, id);
    if (done) {
        ++_edits;
    }
    return done;
}

bool HdTrapezeRenderParam::Check(trz_result result, SdfPath const& id) const {
    if (result != TRZ_OK) {
        Warn(id, std::string(trz_last_error()) + " (" + trz_result_name(result) + ")");
    }
    return result == TRZ_OK;
}

void HdTrapezeRenderParam::Warn(SdfPath const& id, std::string const& text) const {
    if (id.IsEmpty()) {
        TF_WARN("Trapeze: %s", text.c_str());
    } else {
        TF_WARN("Trapeze <%s>: %s", id.GetText(), text.c_str());
    }
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

GfInterval HdTrapezeRenderParam::Shutter() const {
    std::lock_guard<std::mutex> lock(_mutex);
    return _shutter;
}

void HdTrapezeRenderParam::SetShutterOf(void const* owner, GfInterval const& shutter) {
    std::lock_guard<std::mutex> lock(_mutex);
    if (shutter.IsEmpty()) {
        _shutters.erase(owner);
    } else {
        _shutters[owner] = shutter;
    }
}

bool HdTrapezeRenderParam::SampleShutter(HdChangeTracker& tracker) {
    std::lock_guard<std::mutex> lock(_mutex);
    GfInterval shutter(0.0, 0.0);
    for (auto const& [owner, interval] : _shutters) {
        shutter |= interval;
    }
    if (_shutter.Contains(shutter)) {
        return false;
    }
    _shutter = shutter;
    _MarkMotionDirty(tracker);
    return true;
}

namespace {

HdDirtyBits const _primMotion =
    HdChangeTracker::DirtyTransform | HdChangeTracker::DirtyPoints | HdChangeTracker::DirtyPrimvar;
HdDirtyBits const _instancerMotion =
    HdChangeTracker::DirtyTransform | HdChangeTracker::DirtyPrimvar;

} // namespace

// With the mutex held.
void HdTrapezeRenderParam::_MarkMotionDirty(HdChangeTracker& tracker) const {
    for (auto const& [id, prim] : _prims) {
        tracker.MarkRprimDirty(id, _primMotion);
    }
    for (auto const& [id, instancer] : _instancers) {
        tracker.MarkInstancerDirty(id, _instancerMotion);
    }
}

bool HdTrapezeRenderParam::MarkMotionDirty(HdRenderIndex& index, bool onlyOldHosts) const {
    // Prims of scene delegates are told by what their scene index says.
    HdSceneIndexBaseRefPtr const scene = index.GetTerminalSceneIndex();
    auto const isMarked = [&](SdfPath const& id) {
        if (!onlyOldHosts || !scene) {
            return true;
        }
        HdContainerDataSourceHandle const source = scene->GetPrim(id).dataSource;
        return source && source->Get(HdSceneIndexEmulationTokens->sceneDelegate);
    };
    HdChangeTracker& tracker = index.GetChangeTracker();
    std::lock_guard<std::mutex> lock(_mutex);
    bool any = false;
    for (auto const& [id, prim] : _prims) {
        if (isMarked(id)) {
            tracker.MarkRprimDirty(id, _primMotion);
            any = true;
        }
    }
    for (auto const& [id, instancer] : _instancers) {
        if (isMarked(id)) {
            tracker.MarkInstancerDirty(id, _instancerMotion);
            any = true;
        }
    }
    return any;
}

bool HdTrapezeRenderParam::SetTimeCodesPerSecond(double rate, HdChangeTracker& tracker) {
    if (!(rate > 0.0) || _timeCodesPerSecond.exchange(rate) == rate) {
        return false;
    }
    std::lock_guard<std::mutex> lock(_mutex);
    _MarkMotionDirty(tracker);
    return true;
}

bool HdTrapezeRenderParam::WantPrimvars(std::set<TfToken> const& names, HdChangeTracker& tracker) {
    std::lock_guard<std::mutex> lock(_mutex);
    size_t const before = _wanted.size();
    _wanted.insert(names.begin(), names.end());
    if (_wanted.size() == before) {
        return false;
    }
    for (auto const& [id, prim] : _prims) {
        tracker.MarkRprimDirty(id, HdChangeTracker::DirtyPrimvar);
    }
    for (auto const& [id, instancer] : _instancers) {
        tracker.MarkInstancerDirty(id, HdChangeTracker::DirtyPrimvar);
    }
    return true;
}

std::set<TfToken> HdTrapezeRenderParam::WantedPrimvars() const {
    std::lock_guard<std::mutex> lock(_mutex);
    return _wanted;
}

void HdTrapezeRenderParam::AddPrim(SdfPath const& id, HdTrapezePrim* prim) {
    std::lock_guard<std::mutex> lock(_mutex);
    _prims[id] = prim;
    ++_visibilityVersion;
}

void HdTrapezeRenderParam::RemovePrim(SdfPath const& id) {
    std::lock_guard<std::mutex> lock(_mutex);
    _prims.erase(id);
}

void HdTrapezeRenderParam::AddInstancer(SdfPath const& id, HdTrapezeInstancer* instancer) {
    std::lock_guard<std::mutex> lock(_mutex);
    _instancers[id] = instancer;
}

void HdTrapezeRenderParam::RemoveInstancer(SdfPath const& id) {
    std::lock_guard<std::mutex> lock(_mutex);
    _instancers.erase(id);
}

HdTrapezeInstancer* HdTrapezeRenderParam::FindInstancer(SdfPath const& id) const {
    std::lock_guard<std::mutex> lock(_mutex);
    auto const found = _instancers.find(id);
    return found == _instancers.end() ? nullptr : found->second;
}

void HdTrapezeRenderParam::AddRenderSettings(SdfPath const& id, HdTrapezeRenderSettings* settings) {
    std::lock_guard<std::mutex> lock(_mutex);
    _renderSettings[id] = settings;
}

void HdTrapezeRenderParam::RemoveRenderSettings(SdfPath const& id) {
    std::lock_guard<std::mutex> lock(_mutex);
    _renderSettings.erase(id);
}

HdTrapezeRenderSettings* HdTrapezeRenderParam::FindRenderSettings(SdfPath const& id) const {
    std::lock_guard<std::mutex> lock(_mutex);
    auto const found = _renderSettings.find(id);
    return found == _renderSettings.end() ? nullptr : found->second;
}

void HdTrapezeRenderParam::CommitInstancers() {
    std::vector<HdTrapezeInstancer*> instancers;
    {
        std::lock_guard<std::mutex> lock(_mutex);
        for (auto const& [id, instancer] : _instancers) {
            instancers.push_back(instancer);
        }
    }
    for (HdTrapezeInstancer* instancer : instancers) {
        instancer->CommitGroups(*this);
    }
    for (HdTrapezeInstancer* instancer : instancers) {
        instancer->CommitParts(*this);
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
