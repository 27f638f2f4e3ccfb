#include "renderSettings.h"

#include "renderParam.h"
#include "schema.h"

#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/sceneDelegate.h"
#include "pxr/imaging/hd/sceneGlobalsSchema.h"
#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/imaging/hd/tokens.h"
#include "pxr/imaging/hd/utils.h"
#include "pxr/imaging/hd/version.h"

#include <algorithm>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

TF_DEFINE_PRIVATE_TOKENS(_tokens,
                         (instantaneousShutter)(resolution)(dataWindowNDC)((default_, "default"))(
                             (usdRenderSettings, "__usdRenderSettings"))((usdRenderProduct,
                                                                          "__usdRenderProduct")));

// An attribute of a RenderSettings or RenderProduct prim, of scene indices.
template <class T>
T _Authored(HdRenderIndex const& index, SdfPath const& id, TfToken const& name, T const& fallback) {
    auto const of = [&](TfToken const& schema, T const& fallback) {
        return HdTrapezeSchema(index, id, HdDataSourceLocator(schema)).Get(name, fallback);
    };
    return of(_tokens->usdRenderSettings, of(_tokens->usdRenderProduct, fallback));
}

} // namespace

void HdTrapezeRenderSettings::_Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam,
                                    HdDirtyBits const*) {
    auto& param = *static_cast<HdTrapezeRenderParam*>(renderParam);
    param.Guard(GetId(), [&] { _Read(delegate->GetRenderIndex(), param); });
}

void HdTrapezeRenderSettings::_Read(HdRenderIndex& index, HdTrapezeRenderParam& param) {
    using Owner = HdTrapezeSettingsLayer::Owner;
    _layer = HdTrapezeReadNamespaced(Owner::Settings, GetNamespacedSettings(), GetId(), param);
    RenderProducts const& products = GetRenderProducts();
#if HD_API_VERSION >= 92
    _disableMotionBlur = GetDisableMotionBlur();
    _disableDepthOfField = GetDisableDepthOfField();
#else
    // Older hosts only tell what comes of it for the products.
    auto const all = [&](bool HdRenderSettings::RenderProduct::* disabled) {
        return !products.empty() && std::all_of(products.begin(), products.end(),
                                                [&](auto const& p) { return p.*disabled; });
    };
    _disableMotionBlur = all(&RenderProduct::disableMotionBlur);
    _disableDepthOfField = all(&RenderProduct::disableDepthOfField);
#endif
    _disableMotionBlur |= HdTrapezeIsInstantaneous(index, GetId());
    // Motion is sampled for the shutters of all products; those of cameras are known.
    GfInterval shutter = _layer.Shutter();
    for (RenderProduct const& product : products) {
        shutter |= HdTrapezeReadNamespaced(Owner::Product, product.namespacedSettings,
                                           product.productPath, param)
                       .Shutter();
    }
#if HD_API_VERSION >= 92
    VtValue const& interval = GetUnionedSamplingInterval();
#else
    VtValue const& interval = GetShutterInterval();
#endif
    if (interval.IsHolding<GfVec2d>()) {
        GfVec2d const times = interval.UncheckedGet<GfVec2d>();
        shutter |= GfInterval(times[0], times[1]);
    }
    param.SetShutterOf(this, shutter);
    param.SampleShutter(index);
}

void HdTrapezeRenderSettings::Finalize(HdRenderParam* renderParam) {
    static_cast<HdTrapezeRenderParam*>(renderParam)->SetShutterOf(this, GfInterval());
}

void HdTrapezeRenderSettings::DisableEffects(trz_settings* settings) const {
    settings->disable_motion_blur |= _disableMotionBlur ? 1 : 0;
    settings->disable_defocus |= _disableDepthOfField ? 1 : 0;
}

void HdTrapezeRenderSettings::CheckPurposes(TfTokenVector const& tags,
                                            HdTrapezeRenderParam& param) const {
    // Nobody may have said this: it is the schema's fallback.
    if (GetIncludedPurposes() == VtArray<TfToken>{_tokens->default_, HdRenderTagTokens->render}) {
        return;
    }
    for (TfToken const& purpose : GetIncludedPurposes()) {
        bool const isDefault = purpose == _tokens->default_;
        if (!isDefault && !tags.empty() &&
            std::find(tags.begin(), tags.end(), purpose) == tags.end()) {
            param.WarnOnce(GetId(), "its includedPurposes names " + purpose.GetString() +
                                        ", which the host leaves out (usdrecord has --purposes)");
        }
    }
}

HdTrapezeSettingsLayer HdTrapezeReadNamespaced(HdTrapezeSettingsLayer::Owner owner,
                                               VtDictionary const& settings, SdfPath const& id,
                                               HdTrapezeRenderParam& param) {
    HdTrapezeSettingsLayer layer(owner);
    for (auto const& [name, value] : settings) {
        std::string why;
        if (HdTrapezeIsSettingName(name) && !layer.Set(TfToken(name), value, &why)) {
            param.WarnOnce(id, why);
        }
    }
    return layer;
}

double HdTrapezeSceneGlobal(HdRenderIndex const& index, char const* name, double fallback) {
    return HdTrapezeSchema(index, HdSceneGlobalsSchema::GetDefaultPrimPath(),
                           HdSceneGlobalsSchema::GetDefaultLocator())
        .Get(TfToken(name), fallback);
}

bool HdTrapezeIsInstantaneous(HdRenderIndex const& index, SdfPath const& id) {
    return _Authored(index, id, _tokens->instantaneousShutter, false);
}

void HdTrapezeReadShape(HdRenderIndex const& index, SdfPath const& id, trz_view* view) {
    HdTrapezeSchema const settings(index, id, HdDataSourceLocator(_tokens->usdRenderSettings));
    if (auto const at = VtValue::Cast<GfVec2i>(settings.Get(_tokens->resolution)); !at.IsEmpty()) {
        std::copy_n(at.UncheckedGet<GfVec2i>().data(), 2, view->resolution);
        view->has_resolution = 1;
    }
    if (auto const at = VtValue::Cast<GfVec4f>(settings.Get(_tokens->dataWindowNDC));
        !at.IsEmpty()) {
        std::copy_n(at.UncheckedGet<GfVec4f>().data(), 4, view->data_window);
        view->has_data_window = 1;
    }
}

HdTrapezeRenderSettings const* HdTrapezeActiveSettings(HdRenderIndex const& index) {
    SdfPath path;
    HdSceneIndexBaseRefPtr const scene = index.GetTerminalSceneIndex();
    if (!scene || !HdUtils::HasActiveRenderSettingsPrim(scene, &path)) {
        return nullptr;
    }
    return static_cast<HdTrapezeRenderSettings const*>(
        index.GetBprim(HdPrimTypeTokens->renderSettings, path));
}

PXR_NAMESPACE_CLOSE_SCOPE
