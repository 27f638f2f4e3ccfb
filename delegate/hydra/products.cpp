#include "products.h"

#include "camera.h"
#include "numbers.h"

#include "pxr/base/vt/dictionary.h"
#include "pxr/imaging/hd/aov.h"

#include <algorithm>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

TF_DEFINE_PRIVATE_TOKENS(_tokens, (color)(color3f)(primvar));

// A value of driver:parameters:aov:KEY, which may be in dictionaries; null where there is none.
VtValue const* _Find(VtDictionary const& settings, std::string const& key) {
    std::string const path = "driver:parameters:aov:" + key;
    auto const found = settings.find(path);
    return found != settings.end() ? &found->second : settings.GetValueAtPath(path);
}

} // namespace

void HdTrapezeProducts::Add(HdRenderSettings::RenderProduct const& product,
                            HdTrapezeCamera const* camera, trz_settings const& settings,
                            trz_session* session) {
    auto const& vars = _vars.emplace_back(_Vars(product, session));
    auto out = HdTrapezeStruct<trz_product>();
    out.path = product.productPath.GetText();
    out.type = product.type.GetText();
    out.name = product.name.GetText();
    out.camera_path = product.cameraPath.GetText();
    if (camera) {
        out.camera = camera->Id();
        out.camera_aspect = camera->GetHorizontalAperture() / camera->GetVerticalAperture();
    }
    std::copy_n(product.resolution.data(), 2, out.resolution);
    std::copy_n(product.dataWindowNDC.GetMin().data(), 2, out.data_window);
    std::copy_n(product.dataWindowNDC.GetMax().data(), 2, out.data_window + 2);
    out.pixel_aspect = product.pixelAspectRatio;
    out.conform = product.aspectRatioConformPolicy.GetText();
    out.settings = &_settings.emplace_back(settings);
    out.vars = vars.data();
    out.var_count = vars.size();
    _all.push_back(&_products.emplace_back(out));
}

std::vector<trz_render_var> HdTrapezeProducts::_Vars(HdRenderSettings::RenderProduct const& product,
                                                     trz_session* session) {
    std::vector<trz_render_var> vars;
    for (auto const& from : product.renderVars) {
        auto const text = [&](std::string const& key) -> char const* {
            VtValue const* const value = _Find(from.namespacedSettings, key);
            return !value                        ? nullptr
                   : value->IsHolding<TfToken>() ? value->UncheckedGet<TfToken>().GetText()
                                                 : _Keep(value->GetWithDefault<std::string>());
        };
        trz_render_var var = {};
        var.path = from.varPath.GetText();
        var.source_name = from.sourceName.c_str();
        var.source_type = from.sourceType.GetText();
        var.data_type = from.dataType.GetText();
        var.format = text("format");
        var.name = text("name");
        var.channel_prefix = text("channel_prefix");
        char aov[1024] = "";
        size_t needed = 0;
        trz_render_var_aov(session, &var, aov, sizeof(aov), &needed);
        HdParsedAovToken const parsed{TfToken(aov)};
        if (parsed.isPrimvar) {
            _primvars.insert(parsed.name);
        }
        // Hydra does not tell whether this is authored or the schema's fallback; of depths, ids and
        // the like it cannot be meant.
        if (from.dataType == _tokens->color3f && _tokens->color != aov &&
            from.sourceType != _tokens->primvar) {
            var.data_type = nullptr;
        }
        vars.push_back(var);
    }
    return vars;
}

PXR_NAMESPACE_CLOSE_SCOPE
