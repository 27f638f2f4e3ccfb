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
#include <limits>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

TF_DEFINE_PRIVATE_TOKENS(_tokens,
                         (instantaneousShutter)(resolution)(dataWindowNDC)((default_, "default"))(
                             (usdRenderSettings, "__usdRenderSettings"))((usdRenderProduct,
                                                                          "__usdRenderProduct")));

// An attribute of a RenderSettings or RenderProduct prim, of scene indices.
template <class T>
std::optional<T> _Authored(HdRenderIndex const& index, SdfPath const& id, TfToken const& name) {
    HdContainerDataSourceHandle const source = HdTrapezeFindSource(index, id);
    for (TfToken const& schema : {_tokens->usdRenderSettings, _tokens->usdRenderProduct}) {
        auto const prim = source ? HdContainerDataSource::Cast(source->Get(schema))
                                 : HdContainerDataSourceHandle();
        if (auto const value =
                prim ? HdTypedSampledDataSource<T>::Cast(prim->Get(name)) : nullptr) {
            return value->GetTypedValue(0.0f);
        }
    }
    return std::nullopt;
}

} // namespace

void HdTrapezeRenderSettings::_Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam,
                                    HdDirtyBits const*) {
    auto& param = *static_cast<HdTrapezeRenderParam*>(renderParam);
    param.renderSettings.Add(GetId(), this);
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
    _disableMotionBlur |= HdTrapezeIsInstantaneous(delegate->GetRenderIndex(), GetId());
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
    param.SampleShutter(delegate->GetRenderIndex());
}

void HdTrapezeRenderSettings::Finalize(HdRenderParam* renderParam) {
    auto& param = *static_cast<HdTrapezeRenderParam*>(renderParam);
    param.SetShutterOf(this, GfInterval());
    param.renderSettings.Remove(GetId());
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

double HdTrapezeCurrentFrame(HdRenderIndex const& index) {
#if HD_API_VERSION >= 71
    if (HdSceneIndexBaseRefPtr const scene = index.GetTerminalSceneIndex()) {
        if (auto const source = HdSceneGlobalsSchema::GetFromSceneIndex(scene).GetCurrentFrame()) {
            return source->GetTypedValue(0.0f);
        }
    }
#else
    (void)index;
#endif
    return std::numeric_limits<double>::quiet_NaN();
}

bool HdTrapezeIsInstantaneous(HdRenderIndex const& index, SdfPath const& id) {
    return _Authored<bool>(index, id, _tokens->instantaneousShutter).value_or(false);
}

void HdTrapezeReadShape(HdRenderIndex const& index, SdfPath const& id, trz_view* view) {
    if (auto const resolution = _Authored<GfVec2i>(index, id, _tokens->resolution)) {
        std::copy_n(resolution->data(), 2, view->resolution);
    }
    if (auto const window = _Authored<GfVec4f>(index, id, _tokens->dataWindowNDC)) {
        std::copy_n(window->data(), 4, view->data_window);
    }
}

SdfPath HdTrapezeActiveSettings(HdRenderIndex const& index) {
    SdfPath path;
    HdSceneIndexBaseRefPtr const scene = index.GetTerminalSceneIndex();
    return scene && HdUtils::HasActiveRenderSettingsPrim(scene, &path) ? path : SdfPath();
}

std::optional<double> HdTrapezeStageRate(HdRenderIndex const& index) {
#if HD_API_VERSION >= 78
    if (HdSceneIndexBaseRefPtr const scene = index.GetTerminalSceneIndex()) {
        if (auto const source =
                HdSceneGlobalsSchema::GetFromSceneIndex(scene).GetTimeCodesPerSecond()) {
            double const rate = source->GetTypedValue(0.0f);
            return rate > 0.0 ? std::optional<double>(rate) : std::nullopt;
        }
    }
#else
    (void)index;
#endif
    return std::nullopt;
}

PXR_NAMESPACE_CLOSE_SCOPE
