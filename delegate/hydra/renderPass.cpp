#include "renderPass.h"

#include "camera.h"
#include "prim.h"
#include "renderBuffer.h"
#include "renderDelegate.h"
#include "renderLoop.h"
#include "renderParam.h"

#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/renderPassState.h"
#include "pxr/imaging/hd/tokens.h"

#include <algorithm>
#include <cmath>
#include <cstring>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Hydra's refine levels as factors on the shading rate, as usdrecord's complexities are for
// `hdtrapeze record`. Level 0 is the limit surface, too.
float _RateOfLevel(int level) {
    static float const rates[] = {1.0f, 0.7f, 0.5f, 0.25f};
    return rates[std::clamp(level, 0, 3)];
}

uint32_t _Policy(CameraUtilConformWindowPolicy policy) {
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

uint32_t _Cull(HdCullStyle style, uint32_t fallback) {
    switch (style) {
    case HdCullStyleBack:
        return TRZ_CULL_BACK;
    case HdCullStyleFront:
        return TRZ_CULL_FRONT;
    case HdCullStyleBackUnlessDoubleSided:
        return TRZ_CULL_BACK_UNLESS_DOUBLE_SIDED;
    default:
        return fallback;
    }
}

// Image, data window and pixel aspect of the settings, from the framing or, of older hosts, the
// viewport. False where there is nothing to render. `origin` is the image's pixel that buffers
// begin with.
bool _SetFraming(HdRenderPassState const& state, trz_settings* settings, GfVec2i* origin) {
    CameraUtilFraming framing = state.GetFraming();
    if (!framing.IsValid()) {
        GfVec4f const viewport = state.GetViewport();
        framing = CameraUtilFraming(
            GfRect2i(GfVec2i(0), static_cast<int>(viewport[2]), static_cast<int>(viewport[3])));
    }
    GfVec2f const size = framing.displayWindow.GetSize();
    GfVec2f const corner = framing.displayWindow.GetMin();
    GfRect2i const& data = framing.dataWindow;
    if (!(size[0] >= 0.5f && size[1] >= 0.5f) || data.IsEmpty()) {
        return false;
    }
    int const x = static_cast<int>(std::lround(corner[0]));
    int const y = static_cast<int>(std::lround(corner[1]));
    settings->width = static_cast<uint32_t>(std::lround(size[0]));
    settings->height = static_cast<uint32_t>(std::lround(size[1]));
    int32_t const window[4] = {data.GetMinX() - x, data.GetMinY() - y, data.GetMaxX() + 1 - x,
                               data.GetMaxY() + 1 - y};
    int32_t const image[4] = {0, 0, static_cast<int32_t>(settings->width),
                              static_cast<int32_t>(settings->height)};
    if (!std::equal(window, window + 4, image)) {
        std::copy(window, window + 4, settings->data_window);
    }
    settings->pixel_aspect = framing.pixelAspectRatio;
    *origin = GfVec2i(-x, -y);
    return true;
}

} // namespace

bool HdTrapezeRenderPass::_View::operator==(_View const& other) const {
    // Settings come from trz_settings_default each time, so that their padding is the same.
    return camera == other.camera && aovs == other.aovs &&
           std::memcmp(&settings, &other.settings, sizeof(settings)) == 0;
}

HdTrapezeRenderPass::HdTrapezeRenderPass(HdRenderIndex* index, HdRprimCollection const& collection,
                                         HdTrapezeRenderDelegate* delegate)
    : HdRenderPass(index, collection), _delegate(delegate) {}

bool HdTrapezeRenderPass::IsConverged() const {
    HdTrapezeRenderLoop const* const loop = _delegate->Loop();
    return !loop || (!_resyncing && loop->IsConverged());
}

// Shows the prims that render tags and collection name.
void HdTrapezeRenderPass::_Include(TfTokenVector const& tags) {
    HdTrapezeRenderParam& param = _delegate->Param();
    uint64_t const version = param.VisibilityVersion();
    if (!_collectionDirty && tags == _tags && version == _visibilityVersion) {
        return;
    }
    _collectionDirty = false;
    _tags = tags;
    _visibilityVersion = version;
    _refineLevel = 0;
    HdRprimCollection const& collection = GetRprimCollection();
    SdfPathVector const& roots = collection.GetRootPaths();
    SdfPathVector const& excluded = collection.GetExcludePaths();
    param.ForEachPrim([&](SdfPath const& id, HdTrapezePrim& prim) {
        auto const isAbove = [&](SdfPath const& path) { return id.HasPrefix(path); };
        bool const tagged =
            tags.empty() || std::find(tags.begin(), tags.end(), prim.RenderTag()) != tags.end();
        bool const collected = std::any_of(roots.begin(), roots.end(), isAbove) &&
                               std::none_of(excluded.begin(), excluded.end(), isAbove);
        prim.Include(id, tagged && collected, param);
        _refineLevel = std::max(_refineLevel, prim.RefineLevel());
    });
}

void HdTrapezeRenderPass::_Push(_View const& view) {
    HdTrapezeRenderParam& param = _delegate->Param();
    SdfPath const none;
    param.Edit(trz_session_set_settings(param.Session(), &view.settings), none);
    param.Edit(trz_session_set_active_camera(param.Session(), view.camera), none);
    std::vector<char const*> names;
    for (std::string const& name : view.aovs) {
        names.push_back(name.c_str());
    }
    param.Edit(trz_session_set_aovs(param.Session(), names.data(), names.size()), none);
}

void HdTrapezeRenderPass::_Execute(HdRenderPassStateSharedPtr const& state,
                                   TfTokenVector const& tags) {
    HdTrapezeRenderParam& param = _delegate->Param();
    HdTrapezeRenderLoop* const loop = _delegate->Loop();
    auto const* const camera = static_cast<HdTrapezeCamera const*>(state->GetCamera());
    HdRenderPassAovBindingVector const& bindings = state->GetAovBindings();
    if (!loop || !camera || bindings.empty()) {
        return;
    }
    HdChangeTracker& tracker = GetRenderIndex()->GetChangeTracker();

    _Include(tags);
    _View view;
    GfVec2i origin;
    view.camera = camera->Id();
    _delegate->FillSettings(&view.settings);
    if (!_SetFraming(*state, &view.settings, &origin)) {
        return;
    }
    view.settings.shading_rate *= _RateOfLevel(_refineLevel);
    view.settings.window_policy = _Policy(state->GetWindowPolicy());
    view.settings.cull = _Cull(state->GetCullStyle(), view.settings.cull);
    view.settings.camera_light = param.HasLights() && state->GetLightingEnabled();

    std::set<TfToken> primvars;
    for (HdRenderPassAovBinding const& binding : bindings) {
        auto* const buffer = static_cast<HdTrapezeRenderBuffer*>(binding.renderBuffer);
        HdParsedAovToken const parsed(binding.aovName);
        if (!buffer || !HdTrapezeRenderDelegate::IsAov(binding.aovName)) {
            continue;
        }
        if (parsed.isPrimvar) {
            primvars.insert(parsed.name);
        }
        std::string const name = binding.aovName.GetString();
        buffer->Bind(param.Session(), loop, name, binding.clearValue, origin);
        if (std::find(view.aovs.begin(), view.aovs.end(), name) == view.aovs.end()) {
            view.aovs.push_back(name);
        }
    }
    param.WantPrimvars(primvars, tracker);

    // Only here is it known which camera renders. Hosts whose samples are those of one camera's
    // shutter have to be asked again when that is another one.
    double const open =
        view.settings.override_shutter ? view.settings.shutter_open : camera->GetShutterOpen();
    double const close =
        view.settings.override_shutter ? view.settings.shutter_close : camera->GetShutterClose();
    bool const other = _camera != camera->GetId() || _shutter[0] != open || _shutter[1] != close;
    _resyncing = false;
    if (other) {
        if (!_camera.IsEmpty()) {
            param.MarkMotionDirty(tracker);
            _resyncing = true;
        }
        _camera = camera->GetId();
        _shutter[0] = open;
        _shutter[1] = close;
    }

    bool const changed = !(view == _view) || param.Edits() != _edits;
    if (changed) {
        _view = view;
        _Push(view);
        _edits = param.Edits();
        loop->Start();
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
