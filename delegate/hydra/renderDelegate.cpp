#include "renderDelegate.h"

#include "camera.h"
#include "commands.h"
#include "ignored.h"
#include "instancer.h"
#include "numbers.h"
#include "renderBuffer.h"
#include "renderPass.h"
#include "renderSettings.h"
#include "rprim.h"
#include "schema.h"

#include "pxr/imaging/hd/extComputation.h"
#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/resourceRegistry.h"
#include "pxr/imaging/hd/tokens.h"

#include <algorithm>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// What skins points, for one.
class _Computation final : public HdExtComputation {
public:
    using HdExtComputation::HdExtComputation;
    void Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam, HdDirtyBits* bits) override {
        static_cast<HdTrapezeRenderParam*>(renderParam)->Guard(GetId(), [&] {
            HdExtComputation::Sync(delegate, renderParam, bits);
        });
    }
};

HdAovDescriptor _Describe(HdFormat format, VtValue const& clear) { return {format, false, clear}; }

HdAovDescriptor _Vector() { return _Describe(HdFormatFloat32Vec3, VtValue(GfVec3f(0.0f))); }

// AOVs besides primvars, and the buffers that hosts make for them.
std::map<TfToken, HdAovDescriptor> const& _Aovs() {
    static auto const aovs = [] {
        auto const id = _Describe(HdFormatInt32, VtValue(-1));
        auto const pair = _Describe(HdFormatFloat32Vec2, VtValue(GfVec2f(0.0f)));
        return std::map<TfToken, HdAovDescriptor>{
            {TfToken("color"), _Describe(HdFormatFloat16Vec4, VtValue(GfVec4f(0.0f)))},
            {TfToken("depth"), _Describe(HdFormatFloat32, VtValue(1.0f))},
            {TfToken("cameraDepth"), _Describe(HdFormatFloat32, VtValue(0.0f))},
            {TfToken("P"), _Vector()},
            {TfToken("normal"), _Vector()},
            {TfToken("Neye"), _Vector()},
            {TfToken("primId"), id},
            {TfToken("instanceId"), id},
            {TfToken("elementId"), id},
            {TfToken("subsetId"), id},
            {TfToken("motionVectors"), pair},
            {TfToken("sampleCount"), _Describe(HdFormatInt32, VtValue(0))},
            {TfToken("cost"), pair},
        };
    }();
    return aovs;
}

} // namespace

HdTrapezeRenderDelegate::HdTrapezeRenderDelegate(HdRenderSettingsMap const& settings)
    : HdRenderDelegate(settings), _param(std::make_unique<HdTrapezeRenderParam>()),
      _registry(std::make_shared<HdResourceRegistry>()) {
    for (auto const& [key, value] : settings) {
        SetRenderSetting(key, value);
    }
    _PopulateDefaultSettings(GetRenderSettingDescriptors());
}

TfTokenVector const& HdTrapezeRenderDelegate::Lights() {
    static TfTokenVector const types = {
        HdPrimTypeTokens->distantLight, HdPrimTypeTokens->domeLight,
        HdPrimTypeTokens->sphereLight,  HdPrimTypeTokens->rectLight,
        HdPrimTypeTokens->diskLight,    HdPrimTypeTokens->cylinderLight,
    };
    return types;
}

TfTokenVector const& HdTrapezeRenderDelegate::GetSupportedRprimTypes() const {
    static TfTokenVector const types = [] {
        TfTokenVector types;
        for (HdTrapezeShape const& shape : HdTrapezeShapes()) {
            types.push_back(shape.type);
        }
        return types;
    }();
    return types;
}

TfTokenVector const& HdTrapezeRenderDelegate::GetSupportedSprimTypes() const {
    static TfTokenVector const types = [] {
        TfTokenVector types = Lights();
        types.insert(types.end(), {HdPrimTypeTokens->camera, HdPrimTypeTokens->extComputation,
                                   HdPrimTypeTokens->material});
        return types;
    }();
    return types;
}

TfTokenVector const& HdTrapezeRenderDelegate::GetSupportedBprimTypes() const {
    static TfTokenVector const types = {HdPrimTypeTokens->renderBuffer,
                                        HdPrimTypeTokens->renderSettings};
    return types;
}

HdRenderSettingDescriptorList HdTrapezeRenderDelegate::GetRenderSettingDescriptors() const {
    return HdTrapezeSettingDescriptors();
}

void HdTrapezeRenderDelegate::SetRenderSetting(TfToken const& key, VtValue const& value) {
    HdRenderDelegate::SetRenderSetting(key, value);
    TfToken const name = HdTrapezeSettingName(key);
    if (!HdTrapezeIsSettingName(name.GetString())) {
        return;
    }
    std::string why;
    VtValue used = value;
    if (!_settings.Set(name, value, &why)) {
        _param->Warn(SdfPath(), why);
        for (HdRenderSettingDescriptor const& setting : GetRenderSettingDescriptors()) {
            used = setting.key == name ? setting.defaultValue : used;
        }
    }
    HdRenderDelegate::SetRenderSetting(name, used);
    _param->SetShutterOf(this, _settings.Shutter());
}

bool HdTrapezeRenderDelegate::IsInteractive() const {
    return GetRenderSetting<bool>(HdRenderSettingsTokens->enableInteractive, true);
}

VtDictionary HdTrapezeRenderDelegate::GetRenderStats() const {
    VtDictionary stats;
    trz_progress const progress = _param->Progress();
    auto numbers = HdTrapezeStruct<trz_statistics>();
    if (trz_statistics_get(_param->Session(), &numbers) != TRZ_OK) {
        return stats;
    }
    static char const* const states[] = {"idle",      "preparing", "rendering", "finished",
                                         "cancelled", "failed",    "paused"};
    std::string const state = progress.state < 7 ? states[progress.state] : "";
    stats["numCompletedSamples"] = static_cast<int>(progress.samples_done);
    stats["percentDone"] = 100.0 * progress.fraction;
    stats["totalClockTime"] = progress.seconds;
    stats["renderProgressAnnotation"] =
        state + TfStringPrintf(", %u of %u samples", progress.samples_done, progress.samples_total);
    stats["state"] = state;
    // Since the delegate was made, which tells what an edit cost.
    stats["edits"] = progress.edits;
    stats["renders"] = progress.view_starts;
    // Of the last commit and render.
    stats["prims"] = numbers.prims;
    stats["instances"] = numbers.instances;
    stats["objects"] = numbers.objects;
    stats["objectsDiced"] = numbers.objects_diced;
    stats["objectsReused"] = numbers.objects_reused;
    stats["objectsPlaced"] = numbers.objects_placed;
    stats["grids"] = numbers.grids;
    stats["micropolygons"] = numbers.micropolygons;
    stats["geometryBytes"] = numbers.geometry_bytes;
    stats["bvhBytes"] = numbers.bvh_bytes;
    stats["peakBytes"] = numbers.peak_bytes;
    stats["translateSeconds"] = numbers.translate_seconds;
    stats["diceSeconds"] = numbers.dice_seconds;
    stats["buildSeconds"] = numbers.build_seconds;
    stats["traceSeconds"] = numbers.trace_seconds;
    stats["rays"] = numbers.rays;
    return stats;
}

TfTokenVector HdTrapezeRenderDelegate::GetRenderSettingsNamespaces() const {
    // The second one holds names and formats of render vars.
    static TfTokenVector const names = {TfToken("trapeze"), TfToken("driver")};
    return names;
}

HdCommandDescriptors HdTrapezeRenderDelegate::GetCommandDescriptors() const {
    return HdTrapezeCommands();
}

bool HdTrapezeRenderDelegate::InvokeCommand(TfToken const& command, HdCommandArgs const& args) {
    return HdTrapezeRunCommand(_param->Session(), command, args);
}

bool HdTrapezeRenderDelegate::IsStopped() const { return _param->Progress().view_stopped; }

bool HdTrapezeRenderDelegate::Stop(bool blocking) {
    return trz_view_stop(_param->Session(), blocking) == TRZ_OK;
}

bool HdTrapezeRenderDelegate::Restart() { return trz_view_resume(_param->Session()) == TRZ_OK; }

bool HdTrapezeRenderDelegate::Pause() { return trz_render_pause(_param->Session(), 1) == TRZ_OK; }

bool HdTrapezeRenderDelegate::Resume() { return trz_render_pause(_param->Session(), 0) == TRZ_OK; }

HdRenderPassSharedPtr
HdTrapezeRenderDelegate::CreateRenderPass(HdRenderIndex* index,
                                          HdRprimCollection const& collection) {
    return std::make_shared<HdTrapezeRenderPass>(index, collection, this);
}

HdInstancer* HdTrapezeRenderDelegate::CreateInstancer(HdSceneDelegate* delegate,
                                                      SdfPath const& id) {
    // Nothing has it synced where it has no prototypes; scene delegates leave it out themselves.
    HdRenderIndex const& index = delegate->GetRenderIndex();
    HdTrapezeSchema const topology(index, id, HdDataSourceLocator(TfToken("instancerTopology")));
    if (!HdTrapezeRenderParam::IsOfDelegate(index, id) &&
        topology.Get(TfToken("prototypes"), VtArray<SdfPath>()).empty()) {
        _param->WarnOnce(id, "it has no prototypes; it is not rendered");
    }
    return new HdTrapezeInstancer(delegate, id);
}

void HdTrapezeRenderDelegate::DestroyInstancer(HdInstancer* instancer) { delete instancer; }

HdRprim* HdTrapezeRenderDelegate::CreateRprim(TfToken const& type, SdfPath const& id) {
    for (HdTrapezeShape const& shape : HdTrapezeShapes()) {
        if (shape.type == type) {
            if (!shape.create) {
                _param->WarnOnce(id, "prims of type " + type.GetString() +
                                         " are not supported; it is left out");
            }
            return new HdTrapezeRprim(id, shape);
        }
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
        return new _Computation(id);
    }
    if (type == HdPrimTypeTokens->material) {
        return new HdTrapezeMaterial(id);
    }
    if (std::count(Lights().begin(), Lights().end(), type)) {
        return new HdTrapezeLight(id);
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
    if (type == HdPrimTypeTokens->renderSettings) {
        return new HdTrapezeRenderSettings(id);
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
    return _Aovs().count(name) || HdParsedAovToken(name).isPrimvar;
}

HdAovDescriptor HdTrapezeRenderDelegate::GetDefaultAovDescriptor(TfToken const& name) const {
    auto const found = _Aovs().find(name);
    return found != _Aovs().end() ? found->second : IsAov(name) ? _Vector() : HdAovDescriptor();
}

PXR_NAMESPACE_CLOSE_SCOPE
