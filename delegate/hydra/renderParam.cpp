#include "renderParam.h"

#include "instancer.h"

#include "pxr/base/tf/diagnostic.h"

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
    if (result == TRZ_OK) {
        ++_edits;
        return true;
    }
    TF_WARN("Trapeze <%s>: %s (%s)", id.GetText(), trz_last_error(), trz_result_name(result));
    return false;
}

GfInterval HdTrapezeRenderParam::_ComputeShutter() const {
    GfInterval shutter(0.0, 0.0);
    if (!_override.IsEmpty()) {
        return shutter | _override;
    }
    for (auto const& [camera, interval] : _cameras) {
        shutter |= interval;
    }
    return shutter;
}

GfInterval HdTrapezeRenderParam::Shutter() const {
    std::lock_guard<std::mutex> lock(_mutex);
    return _shutter;
}

// With the mutex held. True where more has to be sampled than was; a smaller interval waits until
// something else is sampled anew.
bool HdTrapezeRenderParam::_GrowShutter() {
    GfInterval const shutter = _ComputeShutter();
    bool const grown = !_shutter.Contains(shutter);
    if (grown) {
        _shutter = shutter;
    }
    return grown;
}

void HdTrapezeRenderParam::SetShutterOverride(GfInterval const& shutter, HdChangeTracker& tracker) {
    std::unique_lock<std::mutex> lock(_mutex);
    _override = shutter;
    if (_GrowShutter()) {
        lock.unlock();
        MarkMotionDirty(tracker);
    }
}

void HdTrapezeRenderParam::SetCameraShutter(HdTrapezeCamera const* camera,
                                            GfInterval const& shutter, HdChangeTracker& tracker) {
    std::unique_lock<std::mutex> lock(_mutex);
    _cameras[camera] = shutter;
    if (_GrowShutter()) {
        lock.unlock();
        MarkMotionDirty(tracker);
    }
}

void HdTrapezeRenderParam::RemoveCamera(HdTrapezeCamera const* camera) {
    std::lock_guard<std::mutex> lock(_mutex);
    _cameras.erase(camera);
}

void HdTrapezeRenderParam::MarkMotionDirty(HdChangeTracker& tracker) const {
    std::lock_guard<std::mutex> lock(_mutex);
    for (auto const& [id, prim] : _prims) {
        tracker.MarkRprimDirty(id, HdChangeTracker::DirtyTransform | HdChangeTracker::DirtyPoints |
                                       HdChangeTracker::DirtyPrimvar);
    }
    for (auto const& [id, instancer] : _instancers) {
        tracker.MarkInstancerDirty(id,
                                   HdChangeTracker::DirtyTransform | HdChangeTracker::DirtyPrimvar);
    }
}

void HdTrapezeRenderParam::SetTimeCodesPerSecond(double rate, HdChangeTracker& tracker) {
    if (rate > 0.0 && _timeCodesPerSecond.exchange(rate) != rate) {
        MarkMotionDirty(tracker);
    }
}

void HdTrapezeRenderParam::WantPrimvars(std::set<TfToken> const& names, HdChangeTracker& tracker) {
    std::lock_guard<std::mutex> lock(_mutex);
    size_t const before = _wanted.size();
    _wanted.insert(names.begin(), names.end());
    if (_wanted.size() == before) {
        return;
    }
    for (auto const& [id, prim] : _prims) {
        tracker.MarkRprimDirty(id, HdChangeTracker::DirtyPrimvar);
    }
    for (auto const& [id, instancer] : _instancers) {
        tracker.MarkInstancerDirty(id, HdChangeTracker::DirtyPrimvar);
    }
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
