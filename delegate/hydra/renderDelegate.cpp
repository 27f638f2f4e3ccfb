#include "renderDelegate.h"

#include "basisCurves.h"
#include "camera.h"
#include "commands.h"
#include "implicit.h"
#include "instancer.h"
#include "light.h"
#include "mesh.h"
#include "nurbsCurves.h"
#include "nurbsPatch.h"
#include "points.h"
#include "renderBuffer.h"
#include "renderPass.h"
#include "tokens.h"
#include "unsupported.h"

#include "pxr/imaging/hd/extComputation.h"
#include "pxr/imaging/hd/resourceRegistry.h"
#include "pxr/imaging/hd/tokens.h"

#include <algorithm>

PXR_NAMESPACE_OPEN_SCOPE

TF_DEFINE_PUBLIC_TOKENS(HdTrapezeSettingsTokens, HDTRAPEZE_SETTINGS_TOKENS);

namespace {

TfTokenVector const& _Lights() {
    static TfTokenVector const types = {
        HdPrimTypeTokens->distantLight, HdPrimTypeTokens->domeLight,
        HdPrimTypeTokens->sphereLight,  HdPrimTypeTokens->rectLight,
        HdPrimTypeTokens->diskLight,    HdPrimTypeTokens->cylinderLight,
    };
    return types;
}

bool _Has(TfTokenVector const& types, TfToken const& type) {
    return std::find(types.begin(), types.end(), type) != types.end();
}

// A setting as a number or truth value of the type; `fallback` where the host gave none or another.
template <class T> T _Get(HdRenderDelegate const& delegate, TfToken const& key, T const& fallback) {
    VtValue const value = VtValue::Cast<T>(delegate.GetRenderSetting(key));
    return value.IsHolding<T>() ? value.UncheckedGet<T>() : fallback;
}

// Words of a setting, in the order of the C ABI's constants.
uint32_t _GetWord(HdRenderDelegate const& delegate, TfToken const& key,
                  std::vector<std::string> const& words, uint32_t fallback) {
    VtValue const value = delegate.GetRenderSetting(key);
    std::string word;
    if (value.IsHolding<std::string>()) {
        word = value.UncheckedGet<std::string>();
    } else if (value.IsHolding<TfToken>()) {
        word = value.UncheckedGet<TfToken>().GetString();
    } else {
        return fallback;
    }
    auto const found = std::find(words.begin(), words.end(), word);
    return found == words.end() ? fallback : static_cast<uint32_t>(found - words.begin());
}

} // namespace

HdTrapezeRenderDelegate::HdTrapezeRenderDelegate(HdRenderSettingsMap const& settings)
    : HdRenderDelegate(settings), _param(std::make_unique<HdTrapezeRenderParam>()),
      _registry(std::make_shared<HdResourceRegistry>()) {
    if (_param->Session()) {
        _loop = std::make_unique<HdTrapezeRenderLoop>(_param->Session());
    }
    _PopulateDefaultSettings(GetRenderSettingDescriptors());
}

HdTrapezeRenderDelegate::~HdTrapezeRenderDelegate() {
    // The render ends before what it renders.
    _loop.reset();
}

TfTokenVector const& HdTrapezeRenderDelegate::GetSupportedRprimTypes() const {
    static TfTokenVector const types = [] {
        TfTokenVector types = {HdPrimTypeTokens->mesh, HdPrimTypeTokens->basisCurves,
                               HdPrimTypeTokens->points, HdPrimTypeTokens->nurbsPatch,
                               HdPrimTypeTokens->nurbsCurves};
        for (auto const& more : {HdTrapezeImplicit::Types(), HdTrapezeUnsupported::Types()}) {
            types.insert(types.end(), more.begin(), more.end());
        }
        return types;
    }();
    return types;
}

TfTokenVector const& HdTrapezeRenderDelegate::GetSupportedSprimTypes() const {
    static TfTokenVector const types = [] {
        TfTokenVector types = {HdPrimTypeTokens->camera, HdPrimTypeTokens->extComputation};
        types.insert(types.end(), _Lights().begin(), _Lights().end());
        return types;
    }();
    return types;
}

TfTokenVector const& HdTrapezeRenderDelegate::GetSupportedBprimTypes() const {
    static TfTokenVector const types = {HdPrimTypeTokens->renderBuffer};
    return types;
}

HdRenderSettingDescriptorList HdTrapezeRenderDelegate::GetRenderSettingDescriptors() const {
    auto const& t = *HdTrapezeSettingsTokens;
    // usdview shows truth values, ints, floats and strings.
    return {
        {"Samples per pixel", t.samples, VtValue(64)},
        {"Shading rate (pixels)", t.shadingRate, VtValue(1.0f)},
        {"Pixel filter", t.filter, VtValue(std::string("gaussian"))},
        {"Filter width (pixels, 0: the filter's own)", t.filterWidth, VtValue(0.0f)},
        {"Override the camera's shutter", t.overrideShutter, VtValue(false)},
        {"Shutter open (frames)", t.shutterOpen, VtValue(-0.25f)},
        {"Shutter close (frames)", t.shutterClose, VtValue(0.25f)},
        {"Disable motion blur", t.disableMotionBlur, VtValue(false)},
        {"Disable depth of field", t.disableDepthOfField, VtValue(false)},
        {"Curves as", t.curves, VtValue(std::string("auto"))},
        {"Seed", t.seed, VtValue(0)},
        {"Threads (0: all cores)", t.threads, VtValue(0)},
        {"Backend", t.backend, VtValue(std::string("auto"))},
        {"Time codes per second", t.timeCodesPerSecond, VtValue(24.0f)},
    };
}

void HdTrapezeRenderDelegate::SetRenderSetting(TfToken const& key, VtValue const& value) {
    HdRenderDelegate::SetRenderSetting(key, value);
}

void HdTrapezeRenderDelegate::FillSettings(trz_settings* out) const {
    auto const& t = *HdTrapezeSettingsTokens;
    *out = {};
    out->struct_size = sizeof(*out);
    trz_settings_default(out);
    int const samples = _Get(*this, t.samples, static_cast<int>(out->samples));
    out->samples = static_cast<uint32_t>(std::clamp(samples, 1, 1048576));
    float const rate = _Get(*this, t.shadingRate, out->shading_rate);
    out->shading_rate = rate > 0.0f ? rate : out->shading_rate;
    out->filter =
        _GetWord(*this, t.filter, {"box", "gaussian", "mitchell", "blackman-harris"}, out->filter);
    out->filter_width = std::clamp(_Get(*this, t.filterWidth, 0.0f), 0.0f, 64.0f);
    out->override_shutter = _Get(*this, t.overrideShutter, false);
    out->shutter_open = _Get(*this, t.shutterOpen, 0.0f);
    out->shutter_close = std::max<double>(out->shutter_open, _Get(*this, t.shutterClose, 0.0f));
    if (!out->override_shutter) {
        out->shutter_open = out->shutter_close = 0.0;
    }
    out->disable_motion_blur = _Get(*this, t.disableMotionBlur, false);
    out->disable_defocus = _Get(*this, t.disableDepthOfField, false);
    out->curves = _GetWord(*this, t.curves, {"default", "auto", "ribbons", "tubes"}, out->curves);
    out->seed = static_cast<uint32_t>(std::max(0, _Get(*this, t.seed, 0)));
    out->threads = static_cast<uint32_t>(std::clamp(_Get(*this, t.threads, 0), 0, 4096));
    out->backend = _GetWord(*this, t.backend, {"auto", "cpu", "gpu"}, out->backend);
    out->keep_finer = _Get(*this, HdRenderSettingsTokens->enableInteractive, true);
}

VtDictionary HdTrapezeRenderDelegate::GetRenderStats() const {
    VtDictionary stats;
    trz_progress progress = {};
    progress.struct_size = sizeof(progress);
    if (!_param->Session() || trz_render_progress(_param->Session(), &progress) != TRZ_OK) {
        return stats;
    }
    stats["numCompletedSamples"] = static_cast<int>(progress.samples_done);
    stats["percentDone"] = 100.0 * progress.fraction;
    stats["totalClockTime"] = progress.seconds;
    static char const* const states[] = {"idle",     "preparing", "rendering",
                                         "finished", "cancelled", "failed"};
    stats["renderProgressAnnotation"] =
        std::string(progress.state < 6 ? states[progress.state] : "");
    return stats;
}

TfTokenVector HdTrapezeRenderDelegate::GetRenderSettingsNamespaces() const {
    static TfToken const name("trapeze");
    return {name};
}

HdCommandDescriptors HdTrapezeRenderDelegate::GetCommandDescriptors() const {
    return HdTrapezeCommands();
}

bool HdTrapezeRenderDelegate::InvokeCommand(TfToken const& command, HdCommandArgs const& args) {
    return HdTrapezeRunCommand(_param->Session(), command, args);
}

bool HdTrapezeRenderDelegate::IsStopped() const { return !_loop || _loop->IsStopped(); }

bool HdTrapezeRenderDelegate::Stop(bool blocking) {
    if (_loop) {
        _loop->Stop(blocking);
    }
    return true;
}

bool HdTrapezeRenderDelegate::Restart() {
    if (_loop) {
        _loop->Resume();
    }
    return true;
}

HdRenderPassSharedPtr
HdTrapezeRenderDelegate::CreateRenderPass(HdRenderIndex* index,
                                          HdRprimCollection const& collection) {
    return std::make_shared<HdTrapezeRenderPass>(index, collection, this);
}

HdInstancer* HdTrapezeRenderDelegate::CreateInstancer(HdSceneDelegate* delegate,
                                                      SdfPath const& id) {
    return new HdTrapezeInstancer(delegate, id);
}

void HdTrapezeRenderDelegate::DestroyInstancer(HdInstancer* instancer) { delete instancer; }

HdRprim* HdTrapezeRenderDelegate::CreateRprim(TfToken const& type, SdfPath const& id) {
    if (type == HdPrimTypeTokens->mesh) {
        return new HdTrapezeMesh(id);
    }
    if (type == HdPrimTypeTokens->basisCurves) {
        return new HdTrapezeBasisCurves(id);
    }
    if (type == HdPrimTypeTokens->points) {
        return new HdTrapezePoints(id);
    }
    if (type == HdPrimTypeTokens->nurbsPatch) {
        return new HdTrapezeNurbsPatch(id);
    }
    if (type == HdPrimTypeTokens->nurbsCurves) {
        return new HdTrapezeNurbsCurves(id);
    }
    if (_Has(HdTrapezeImplicit::Types(), type)) {
        return new HdTrapezeImplicit(id, type);
    }
    if (_Has(HdTrapezeUnsupported::Types(), type)) {
        return new HdTrapezeUnsupported(id, type);
    }
    TF_CODING_ERROR("Trapeze: no prims of type %s", type.GetText());
    return nullptr;
}

void HdTrapezeRenderDelegate::DestroyRprim(HdRprim* prim) { delete prim; }

HdSprim* HdTrapezeRenderDelegate::CreateSprim(TfToken const& type, SdfPath const& id) {
    if (type == HdPrimTypeTokens->camera) {
        return new HdTrapezeCamera(id);
    }
    if (type == HdPrimTypeTokens->extComputation) {
        return new HdExtComputation(id);
    }
    if (_Has(_Lights(), type)) {
        return new HdTrapezeLight(id, type);
    }
    TF_CODING_ERROR("Trapeze: no state of type %s", type.GetText());
    return nullptr;
}

HdSprim* HdTrapezeRenderDelegate::CreateFallbackSprim(TfToken const& type) {
    return CreateSprim(type, SdfPath::EmptyPath());
}

void HdTrapezeRenderDelegate::DestroySprim(HdSprim* prim) { delete prim; }

HdBprim* HdTrapezeRenderDelegate::CreateBprim(TfToken const& type, SdfPath const& id) {
    if (type == HdPrimTypeTokens->renderBuffer) {
        return new HdTrapezeRenderBuffer(id);
    }
    TF_CODING_ERROR("Trapeze: no buffers of type %s", type.GetText());
    return nullptr;
}

HdBprim* HdTrapezeRenderDelegate::CreateFallbackBprim(TfToken const& type) {
    return CreateBprim(type, SdfPath::EmptyPath());
}

void HdTrapezeRenderDelegate::DestroyBprim(HdBprim* prim) { delete prim; }

void HdTrapezeRenderDelegate::CommitResources(HdChangeTracker*) {
    if (_param->Session()) {
        _param->CommitInstancers();
    }
}

TfToken HdTrapezeRenderDelegate::GetMaterialBindingPurpose() const { return HdTokens->full; }

TfTokenVector HdTrapezeRenderDelegate::GetMaterialRenderContexts() const { return {TfToken()}; }

bool HdTrapezeRenderDelegate::IsAov(TfToken const& name) {
    static std::set<std::string> const names = {
        "color",         "depth",       "cameraDepth", "P",         "normal",
        "Neye",          "primId",      "instanceId",  "elementId", "subsetId",
        "motionVectors", "sampleCount", "cost"};
    return names.count(name.GetString()) || HdParsedAovToken(name).isPrimvar;
}

HdAovDescriptor HdTrapezeRenderDelegate::GetDefaultAovDescriptor(TfToken const& name) const {
    if (!IsAov(name)) {
        return HdAovDescriptor();
    }
    std::string const& aov = name.GetString();
    if (aov == "color") {
        return {HdFormatFloat16Vec4, false, VtValue(GfVec4f(0.0f))};
    }
    if (aov == "depth") {
        return {HdFormatFloat32, false, VtValue(1.0f)};
    }
    if (aov == "primId" || aov == "instanceId" || aov == "elementId" || aov == "subsetId") {
        return {HdFormatInt32, false, VtValue(-1)};
    }
    if (aov == "sampleCount") {
        return {HdFormatInt32, false, VtValue(0)};
    }
    if (aov == "cameraDepth") {
        return {HdFormatFloat32, false, VtValue(0.0f)};
    }
    if (aov == "motionVectors" || aov == "cost") {
        return {HdFormatFloat32Vec2, false, VtValue(GfVec2f(0.0f))};
    }
    return {HdFormatFloat32Vec3, false, VtValue(GfVec3f(0.0f))};
}

PXR_NAMESPACE_CLOSE_SCOPE
