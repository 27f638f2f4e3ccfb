#include "renderPass.h"

#include "camera.h"
#include "prim.h"
#include "renderBuffer.h"
#include "renderDelegate.h"
#include "renderLoop.h"
#include "renderParam.h"
#include "renderSettings.h"

#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/renderPassState.h"
#include "pxr/imaging/hd/tokens.h"

#include <algorithm>
#include <cmath>
#include <set>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Hydra's refine levels as factors on the shading rate, as usdrecord's complexities are for
// `hdtrapeze record`. Level 0 is the limit surface, too.
float _RateOfLevel(int level) {
    static float const rates[] = {1.0f, 0.7f, 0.5f, 0.25f};
    return rates[std::clamp(level, 0, 3)];
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

HdTrapezeRenderPass::HdTrapezeRenderPass(HdRenderIndex* index, HdRprimCollection const& collection,
                                         HdTrapezeRenderDelegate* delegate)
    : HdRenderPass(index, collection), _delegate(delegate) {}

HdTrapezeRenderPass::~HdTrapezeRenderPass() { _delegate->Param().RemovePass(this); }

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
    param.SetIncludedBy(this, {roots, excluded, tags});
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

// Before Rprims are: what they sample motion for.
void HdTrapezeRenderPass::_Sync() { _SampleMotion(); }

// Settles what motion is sampled for, and with which rate. True where prims are to be synced again.
bool HdTrapezeRenderPass::_SampleMotion() {
    HdRenderIndex& index = *GetRenderIndex();
    HdTrapezeRenderParam& param = _delegate->Param();
    HdTrapezeSettings settings;
    if (auto const* const prim = param.FindRenderSettings(HdTrapezeActiveSettings(index))) {
        prim->Apply(&settings);
    }
    _delegate->Settings().Apply(&settings);
    std::optional<double> const told = HdTrapezeStageRate(index);
    double const rate = told.value_or(settings.timeCodesPerSecond);
    bool const sampled = param.SampleShutter(index);
    return param.SetTimeCodesPerSecond(rate, told || settings.isRateTold, index) || sampled;
}

// Older hosts sample motion for the shutter of one camera of their choice, which is the one that
// renders when prims are synced. True where samples lack some of its shutter.
bool HdTrapezeRenderPass::_LacksSamples(HdTrapezeCamera const& camera) {
    HdRenderIndex& index = *GetRenderIndex();
    if (!camera.Sampled().Contains(_delegate->Settings().Shutter())) {
        _delegate->Param().MarkCameraDirty(index, camera.GetId());
        return true;
    }
    GfInterval const shutter = camera.Shutter();
    if (!shutter.Contains(_delegate->Settings().Shutter()) &&
        _delegate->Param().HasDelegates(index)) {
        _delegate->Param().WarnOnce(
            SdfPath(),
            "this host samples motion for its camera's shutter alone: with another shutter, "
            "what moves stands still outside of it");
    }
    uint64_t const edits = _delegate->Param().PrimEdits();
    if (_sampled.IsEmpty()) {
        _sampled = shutter;
    }
    bool const lacks = !_sampled.Contains(shutter);
    if (lacks) {
        _sampled = shutter;
    } else if (edits != _sampledEdits) {
        // What was synced since has samples of this one.
        _sampled &= shutter;
    }
    _sampledEdits = edits;
    return lacks &&
           _delegate->Param().MarkMotionDirty(index, HdTrapezeRenderParam::Source::Delegates);
}

// The view of the host's own image; false where there is nothing to render.
bool HdTrapezeRenderPass::_MakeView(HdRenderPassState const& state,
                                    HdTrapezeRenderSettings const* prim, HdTrapezeView* view) {
    HdTrapezeRenderParam& param = _delegate->Param();
    auto const* const camera = static_cast<HdTrapezeCamera const*>(state.GetCamera());
    HdTrapezeSettings settings;
    if (prim) {
        prim->Apply(&settings);
    }
    _delegate->Settings().Apply(&settings);
    view->camera = camera->Id();
    view->settings = HdTrapezeFinish(settings);
    if (prim) {
        prim->DisableEffects(&view->settings);
    }
    GfVec2i origin;
    if (!_SetFraming(state, &view->settings, &origin)) {
        return false;
    }
    view->settings.keep_finer = _delegate->IsInteractive();
    view->settings.shading_rate *= _RateOfLevel(_refineLevel);
    view->settings.window_policy = HdTrapezeWindowPolicy(state.GetWindowPolicy());
    view->settings.cull = _Cull(state.GetCullStyle(), view->settings.cull);
    view->settings.camera_light =
        param.HasLights() && state.GetLightingEnabled() && settings.cameraLight;
    for (HdRenderPassAovBinding const& binding : state.GetAovBindings()) {
        auto* const buffer = static_cast<HdTrapezeRenderBuffer*>(binding.renderBuffer);
        if (buffer && HdTrapezeRenderDelegate::IsAov(binding.aovName)) {
            std::string const& name = binding.aovName.GetString();
            buffer->Bind(param.Session(), _delegate->Loop(), name, binding.clearValue, origin);
            view->AddAov(name);
        }
    }
    return true;
}

// What is rendered: the host's image and, of hosts that want files, the products.
std::vector<HdTrapezeRender> HdTrapezeRenderPass::_Plan(HdTrapezeView const& view,
                                                        HdTrapezeRenderSettings const* prim) {
    if (!prim || _delegate->IsInteractive()) {
        return {{view, {}}};
    }
    HdTrapezeSettings settings;
    prim->Apply(&settings);
    return HdTrapezePlan(*prim, {*GetRenderIndex(), _delegate->Param(), view, _delegate->Settings(),
                                 settings, _RateOfLevel(_refineLevel)});
}

void HdTrapezeRenderPass::_Start() {
    HdTrapezeRenderParam& param = _delegate->Param();
    // The session knows at once, unless the loop may be between several.
    _hasSeveral |= _renders.size() > 1;
    if (!_hasSeveral) {
        _renders.front().view.Push(param);
    }
    std::vector<HdTrapezeRenderLoop::Job> jobs;
    for (HdTrapezeRender const& render : _renders) {
        jobs.push_back({[&param, push = _hasSeveral, view = render.view] {
                            if (push) {
                                view.Push(param);
                            }
                        },
                        [&param, files = render.files](std::string const& failure) {
                            for (HdTrapezeFile const& file : files) {
                                file.Write(param, failure);
                            }
                            param.TellFailure(failure);
                        }});
    }
    _delegate->Loop()->Start(std::move(jobs));
}

void HdTrapezeRenderPass::_Execute(HdRenderPassStateSharedPtr const& state,
                                   TfTokenVector const& tags) {
    HdTrapezeRenderParam& param = _delegate->Param();
    auto const* const camera = static_cast<HdTrapezeCamera const*>(state->GetCamera());
    if (!_delegate->Loop() || !camera || state->GetAovBindings().empty()) {
        return;
    }
    HdRenderIndex& index = *GetRenderIndex();
    HdTrapezeRenderSettings const* const prim =
        param.FindRenderSettings(HdTrapezeActiveSettings(index));
    _Include(tags);
    if (prim) {
        prim->CheckPurposes(tags, param);
    }
    HdTrapezeView view;
    if (!_MakeView(*state, prim, &view)) {
        return;
    }
    double frame = 0.0;
    HdTrapezeCurrentFrame(index, &frame);
    _State now = {view, prim, prim ? prim->Version() : 0, frame, param.Edits()};
    bool const changed = !(now == _state);
    std::vector<HdTrapezeRender> renders = changed ? _Plan(view, prim) : _renders;
    std::set<TfToken> primvars;
    for (HdTrapezeRender const& render : renders) {
        for (std::string const& aov : render.view.aovs) {
            HdParsedAovToken const parsed{TfToken(aov)};
            if (parsed.isPrimvar) {
                primvars.insert(parsed.name);
            }
        }
    }
    // Only here is it known what renders. What has to be synced for it again is at the next call.
    bool const wants = param.WantPrimvars(primvars, index);
    bool const samples = _SampleMotion();
    _resyncing = _LacksSamples(*camera) || wants || samples;
    if (_resyncing || !changed) {
        return;
    }
    bool const isSame = renders == _renders && now.edits == _state.edits;
    _state = std::move(now);
    if (!isSame) {
        _renders = std::move(renders);
        _Start();
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
