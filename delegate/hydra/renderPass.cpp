#include "renderPass.h"

#include "camera.h"
#include "numbers.h"
#include "renderBuffer.h"
#include "renderDelegate.h"
#include "renderParam.h"
#include "renderSettings.h"
#include "rprim.h"

#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/renderPassState.h"
#include "pxr/imaging/hd/tokens.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Hydra's refine levels as factors on the shading rate, as usdrecord's complexities are for
// `hdtrapeze record`. Level 0 is the limit surface, too.
float _RateOfLevel(int level) {
    static float const rates[] = {1.0f, 0.7f, 0.5f, 0.25f};
    return rates[std::clamp(level, 0, 3)];
}

uint32_t _WindowPolicy(CameraUtilConformWindowPolicy policy) {
    static std::map<CameraUtilConformWindowPolicy, uint32_t> const policies = {
        {CameraUtilMatchHorizontally, TRZ_WINDOW_MATCH_HORIZONTALLY},
        {CameraUtilMatchVertically, TRZ_WINDOW_MATCH_VERTICALLY},
        {CameraUtilFit, TRZ_WINDOW_FIT},
        {CameraUtilCrop, TRZ_WINDOW_CROP},
    };
    auto const found = policies.find(policy);
    return found == policies.end() ? TRZ_WINDOW_DONT_CONFORM : found->second;
}

uint32_t _Cull(HdCullStyle style, uint32_t fallback) {
    static std::map<HdCullStyle, uint32_t> const styles = {
        {HdCullStyleBack, TRZ_CULL_BACK},
        {HdCullStyleFront, TRZ_CULL_FRONT},
        {HdCullStyleBackUnlessDoubleSided, TRZ_CULL_BACK_UNLESS_DOUBLE_SIDED},
    };
    auto const found = styles.find(style);
    return found == styles.end() ? fallback : found->second;
}

// Whether the host has lights: those of the scene, or the one that it puts at the camera.
bool _HasLights(HdRenderIndex& index) {
    auto const& types = HdTrapezeRenderDelegate::Lights();
    return std::any_of(types.begin(), types.end(), [&](TfToken const& type) {
        return !index.GetSprimSubtree(type, SdfPath::AbsoluteRootPath()).empty();
    });
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
    GfVec2f const corner = framing.displayWindow.GetMin();
    GfVec2f const size = framing.displayWindow.GetSize();
    GfRect2i data = framing.dataWindow;
    if (!(size[0] >= 0.5f && size[1] >= 0.5f) || data.IsEmpty()) {
        return false;
    }
    *origin = GfVec2i(-std::lround(corner[0]), -std::lround(corner[1]));
    settings->width = static_cast<uint32_t>(std::lround(size[0]));
    settings->height = static_cast<uint32_t>(std::lround(size[1]));
    settings->pixel_aspect = framing.pixelAspectRatio;
    data.Translate(*origin);
    if (data != GfRect2i(GfVec2i(0), settings->width, settings->height)) {
        std::copy_n(data.GetMin().data(), 2, settings->data_window);
        std::copy_n((data.GetMax() + GfVec2i(1)).data(), 2, settings->data_window + 2);
    }
    return true;
}

} // namespace

HdTrapezeRenderPass::HdTrapezeRenderPass(HdRenderIndex* index, HdRprimCollection const& collection,
                                         HdTrapezeRenderDelegate* delegate)
    : HdRenderPass(index, collection), _delegate(delegate) {}

HdTrapezeRenderPass::~HdTrapezeRenderPass() { _delegate->Param().RemovePass(this); }

bool HdTrapezeRenderPass::IsConverged() const {
    return !_resyncing && _delegate->Param().Progress().view_converged;
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
    for (auto const& [path, prim] : param.prims.All()) {
        SdfPath const& id = path;
        auto const isAbove = [&](SdfPath const& path) { return id.HasPrefix(path); };
        bool const tagged =
            tags.empty() || std::find(tags.begin(), tags.end(), prim->GetRenderTag()) != tags.end();
        bool const collected = std::any_of(roots.begin(), roots.end(), isAbove) &&
                               std::none_of(excluded.begin(), excluded.end(), isAbove);
        prim->Include(tagged && collected, param);
        _refineLevel = std::max(_refineLevel, prim->RefineLevel());
    }
}

// Before Rprims are: what they sample motion for.
void HdTrapezeRenderPass::_Sync() { _SampleMotion(); }

// Settles what motion is sampled for, and with which rate. True where prims are to be synced again.
bool HdTrapezeRenderPass::_SampleMotion() {
    HdRenderIndex& index = *GetRenderIndex();
    HdTrapezeRenderParam& param = _delegate->Param();
    trz_settings settings = HdTrapezeDefaultSettings();
    if (auto const* const prim = HdTrapezeActiveSettings(index)) {
        prim->Apply(&settings);
    }
    _delegate->Settings().Apply(&settings);
    double const told = HdTrapezeSceneGlobal(index, "timeCodesPerSecond", 0.0);
    double const rate = told > 0.0 ? told : settings.time_codes_per_second;
    bool const sampled = param.SampleShutter(index);
    return param.SetTimeCodesPerSecond(rate > 0.0 ? rate : 24.0, rate > 0.0, index) || sampled;
}

// True where a camera lacks samples of the shutter that the host asks for: it is synced again.
bool HdTrapezeRenderPass::_LacksShutter(HdTrapezeCamera const& camera) {
    bool const lacks = !camera.Sampled().Contains(_delegate->Settings().Shutter());
    if (lacks) {
        camera.SampleAgain(*GetRenderIndex(), _delegate->Param());
    }
    return lacks;
}

// Older hosts sample motion for the shutter of one camera of their choice, which is the one that
// renders when prims are synced. True where samples lack some of its shutter.
bool HdTrapezeRenderPass::_LacksSamples(HdTrapezeCamera const& camera) {
    HdRenderIndex& index = *GetRenderIndex();
    GfInterval const shutter = camera.Shutter();
    if (!shutter.Contains(_delegate->Settings().Shutter()) &&
        _delegate->Param().HasDelegates(index)) {
        _delegate->Param().WarnOnce(
            SdfPath(),
            "this host samples motion for its camera's shutter alone: with another shutter, "
            "what moves stands still outside of it");
    }
    trz_progress const progress = _delegate->Param().Progress();
    uint64_t const edits = progress.edits - progress.camera_edits;
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

// Settings and AOVs of the host's own image; false where there is nothing to render.
bool HdTrapezeRenderPass::_MakeView(HdRenderPassState const& state,
                                    HdTrapezeRenderSettings const* prim, trz_settings* settings,
                                    std::vector<char const*>* aovs) {
    HdTrapezeRenderParam& param = _delegate->Param();
    if (prim) {
        prim->Apply(settings);
    }
    _delegate->Settings().Apply(settings);
    if (prim) {
        prim->DisableEffects(settings);
    }
    GfVec2i origin;
    if (!_SetFraming(state, settings, &origin)) {
        return false;
    }
    settings->keep_finer = _delegate->IsInteractive();
    settings->shading_rate *= _RateOfLevel(_refineLevel);
    settings->window_policy = _WindowPolicy(state.GetWindowPolicy());
    settings->cull = _Cull(state.GetCullStyle(), settings->cull);
    settings->camera_light &= state.GetLightingEnabled() && _HasLights(*GetRenderIndex()) ? 1 : 0;
    for (HdRenderPassAovBinding const& binding : state.GetAovBindings()) {
        auto* const buffer = static_cast<HdTrapezeRenderBuffer*>(binding.renderBuffer);
        if (buffer && HdTrapezeRenderDelegate::IsAov(binding.aovName)) {
            buffer->Bind(&param, binding.aovName.GetString(), binding.clearValue, origin);
            aovs->push_back(binding.aovName.GetText());
        }
    }
    return true;
}

// The products of a settings prim. `own` are the settings of the host's image.
HdTrapezeProducts HdTrapezeRenderPass::_Products(HdTrapezeRenderSettings const& prim,
                                                 trz_settings const& own) {
    HdRenderIndex const& index = *GetRenderIndex();
    HdTrapezeRenderParam& param = _delegate->Param();
    HdTrapezeProducts products;
    for (auto const& product : prim.GetRenderProducts()) {
        SdfPath const& id = product.productPath;
        trz_settings settings = HdTrapezeDefaultSettings();
        prim.Apply(&settings);
        HdTrapezeReadNamespaced(HdTrapezeSettingsLayer::Owner::Product, product.namespacedSettings,
                                id, param)
            .Apply(&settings);
        _delegate->Settings().Apply(&settings);
        settings.disable_motion_blur |= product.disableMotionBlur ||
                                        HdTrapezeIsInstantaneous(index, id) ||
                                        HdTrapezeIsInstantaneous(index, prim.GetId());
        settings.disable_defocus |= product.disableDepthOfField ? 1 : 0;
        settings.shading_rate *= _RateOfLevel(_refineLevel);
        settings.camera_light &= own.camera_light;
        settings.keep_finer = own.keep_finer;
        auto const* const camera = static_cast<HdTrapezeCamera const*>(
            index.GetSprim(HdPrimTypeTokens->camera, product.cameraPath));
        _resyncing |= camera && _LacksShutter(*camera);
        products.Add(product, camera, settings, param.Session());
    }
    return products;
}

void HdTrapezeRenderPass::_Execute(HdRenderPassStateSharedPtr const& state,
                                   TfTokenVector const& tags) {
    HdTrapezeRenderParam& param = _delegate->Param();
    auto const* const camera = static_cast<HdTrapezeCamera const*>(state->GetCamera());
    if (!param.Session() || !camera || state->GetAovBindings().empty()) {
        return;
    }
    HdRenderIndex& index = *GetRenderIndex();
    HdTrapezeRenderSettings const* const prim = HdTrapezeActiveSettings(index);
    _Include(tags);
    if (prim) {
        prim->CheckPurposes(tags, param);
    }
    trz_settings settings = HdTrapezeDefaultSettings();
    std::vector<char const*> aovs;
    if (!_MakeView(*state, prim, &settings, &aovs)) {
        return;
    }
    _resyncing = _LacksShutter(*camera);
    // Of hosts that want files.
    HdTrapezeProducts const products =
        prim && !_delegate->IsInteractive() ? _Products(*prim, settings) : HdTrapezeProducts();
    std::set<TfToken> primvars = products.Primvars();
    for (char const* const aov : aovs) {
        HdParsedAovToken const parsed{TfToken(aov)};
        if (parsed.isPrimvar) {
            primvars.insert(parsed.name);
        }
    }
    // Only here is it known what renders. What has to be synced for it again is at the next call.
    bool const wants = param.WantPrimvars(primvars, index);
    bool const samples = _SampleMotion();
    _resyncing |= _LacksSamples(*camera) || wants || samples;
    if (_resyncing) {
        return;
    }
    auto view = HdTrapezeStruct<trz_view>();
    view.camera = camera->Id();
    view.settings = &settings;
    view.aovs = aovs.data();
    view.aov_count = static_cast<uint32_t>(aovs.size());
    // Not finite of hosts that do not tell, and at the default time.
    view.frame =
        HdTrapezeSceneGlobal(index, "currentFrame", std::numeric_limits<double>::quiet_NaN());
    if (prim) {
        view.settings_path = prim->GetId().GetText();
        HdTrapezeReadShape(index, prim->GetId(), &view);
    }
    trz_result const result =
        trz_view_render(param.Session(), &view, products.All().data(), products.All().size());
    if (result != TRZ_OK && result != TRZ_ERROR_POISONED) {
        param.WarnOnce(SdfPath(), trz_last_error());
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
