#include "products.h"

#include "camera.h"
#include "renderParam.h"
#include "renderSettings.h"

#include "pxr/base/tf/pathUtils.h"
#include "pxr/base/tf/stringUtils.h"
#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/tokens.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <regex>
#include <set>
#include <tuple>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

TF_DEFINE_PRIVATE_TOKENS(_tokens, (raster)(color3f)(primvar));

std::string const _driver = "driver:parameters:aov:";

// A name of which every placeholder is replaced by the frame: ####, ##.##, <F4>, $F4, ${F4}, %04d.
std::string _ExpandFrame(std::string const& name, double frame) {
    static std::regex const places(
        R"(<F(\d?)>|\$F(\d?)|\$\{F(\d?)\}|%(?:0(\d+))?d|(#+)(?:\.(#+))?)");
    std::string expanded;
    size_t end = 0;
    for (std::sregex_iterator at(name.begin(), name.end(), places), none; at != none; ++at) {
        std::smatch const& match = *at;
        expanded += name.substr(end, match.position() - end);
        end = match.position() + match.length();
        if (match.length(5)) {
            expanded += TfStringPrintf("%0*.*f", static_cast<int>(match.length()),
                                       static_cast<int>(match.length(6)), frame);
            continue;
        }
        int digits = 1;
        for (size_t group = 1; group <= 4; ++group) {
            if (match.length(group)) {
                // No file has more digits than three tell.
                digits = match.length(group) > 3 ? 64 : std::stoi(match[group]);
            }
        }
        expanded += TfStringPrintf("%0*lld", std::min(digits, 64),
                                   static_cast<long long>(std::floor(frame)));
    }
    return expanded + name.substr(end);
}

std::string _Text(VtDictionary const& settings, std::string const& key) {
    VtValue const* const value = settings.GetValueAtPath(key);
    VtDictionary::const_iterator const found = settings.find(key);
    VtValue const& text = found != settings.end() ? found->second : value ? *value : VtValue();
    return text.IsHolding<TfToken>() ? text.UncheckedGet<TfToken>().GetString()
                                     : text.GetWithDefault<std::string>();
}

bool _Has(VtDictionary const& settings, std::string const& key) {
    return settings.count(key) || settings.GetValueAtPath(key);
}

uint32_t _Policy(TfToken const& policy) {
    auto const& t = *HdAspectRatioConformPolicyTokens;
    std::map<TfToken, uint32_t> const policies = {
        {t.expandAperture, TRZ_WINDOW_FIT},
        {t.cropAperture, TRZ_WINDOW_CROP},
        {t.adjustApertureWidth, TRZ_WINDOW_MATCH_VERTICALLY},
        {t.adjustApertureHeight, TRZ_WINDOW_MATCH_HORIZONTALLY},
        {t.adjustPixelAspectRatio, TRZ_WINDOW_DONT_CONFORM},
    };
    auto const found = policies.find(policy);
    return found == policies.end() ? TRZ_WINDOW_FIT : found->second;
}

// The image of a product. Empty where it can be; else why not.
std::string _SetImage(HdRenderSettings::RenderProduct const& product, HdCamera const& camera,
                      trz_settings* settings) {
    int const width = product.resolution[0];
    int const height = product.resolution[1];
    if (width < 1 || height < 1 || width > 65536 || height > 65536) {
        return TfStringPrintf("its resolution is %d x %d", width, height);
    }
    settings->width = width;
    settings->height = height;
    settings->window_policy = _Policy(product.aspectRatioConformPolicy);
    float const aspect = product.pixelAspectRatio;
    settings->pixel_aspect = aspect >= 0.001f && aspect <= 1000.0f ? aspect : 1.0f;
    if (settings->window_policy == TRZ_WINDOW_DONT_CONFORM && camera.GetVerticalAperture() > 0.0f) {
        settings->pixel_aspect = camera.GetHorizontalAperture() / camera.GetVerticalAperture() *
                                 static_cast<float>(height) / static_cast<float>(width);
    }
    std::fill(std::begin(settings->data_window), std::end(settings->data_window), 0);
    GfRange2f const& window = product.dataWindowNDC;
    if (window == GfRange2f(GfVec2f(0.0f), GfVec2f(1.0f))) {
        return {};
    }
    for (float edge :
         {window.GetMin()[0], window.GetMin()[1], window.GetMax()[0], window.GetMax()[1]}) {
        if (!(std::abs(edge) <= 100.0f)) {
            return "its data window reaches absurdly far out of the image";
        }
    }
    // A pixel whose centre is inside is rendered. NDC's y goes up.
    auto const pixel = [](double edge, int size) {
        return static_cast<int>(std::ceil(edge * size - 0.5));
    };
    int const pixels[4] = {
        pixel(window.GetMin()[0], width), height - pixel(window.GetMax()[1], height),
        pixel(window.GetMax()[0], width), height - pixel(window.GetMin()[1], height)};
    if (pixels[0] >= pixels[2] || pixels[1] >= pixels[3]) {
        return TfStringPrintf("its data window holds no pixel of an image of %d x %d", width,
                              height);
    }
    if (std::max(pixels[2], width) - std::min(pixels[0], 0) > 65536 ||
        std::max(pixels[3], height) - std::min(pixels[1], 0) > 65536) {
        return "its image and overscan span more than 65536 pixels";
    }
    int const image[4] = {0, 0, width, height};
    if (!std::equal(pixels, pixels + 4, image)) {
        std::copy(pixels, pixels + 4, settings->data_window);
    }
    return {};
}

// The AOV that a var is written from; empty where the library leaves it out, with its own warning.
std::string _Aov(trz_session* session, trz_render_var const& var) {
    char name[1024] = "";
    size_t needed = 0;
    return trz_render_var_aov(session, &var, name, sizeof(name), &needed) == TRZ_OK ? name : "";
}

// The vars that can be written; their AOVs go to the view.
std::vector<HdTrapezeFile::Var> _Vars(HdRenderSettings::RenderProduct const& product,
                                      trz_session* session, HdTrapezeView* view) {
    std::vector<HdTrapezeFile::Var> vars;
    for (auto const& from : product.renderVars) {
        HdTrapezeFile::Var var;
        var.path = from.varPath.GetString();
        var.sourceName = from.sourceName;
        var.sourceType = from.sourceType.GetString();
        var.dataType = from.dataType.GetString();
        var.format = _Text(from.namespacedSettings, _driver + "format");
        var.name = _Text(from.namespacedSettings, _driver + "name");
        var.hasPrefix = _Has(from.namespacedSettings, _driver + "channel_prefix");
        var.channelPrefix = _Text(from.namespacedSettings, _driver + "channel_prefix");
        std::string const aov = _Aov(session, var.View());
        if (aov.empty()) {
            continue;
        }
        // Hydra does not tell whether this is authored or the schema's fallback; of depths, ids and
        // the like it cannot be meant.
        if (from.dataType == _tokens->color3f && aov != "color" &&
            from.sourceType != _tokens->primvar) {
            var.dataType.clear();
        }
        view->AddAov(aov);
        vars.push_back(std::move(var));
    }
    return vars;
}

} // namespace

trz_render_var HdTrapezeFile::Var::View() const {
    auto const text = [](std::string const& s) { return s.empty() ? nullptr : s.c_str(); };
    trz_render_var var = {};
    var.path = path.c_str();
    var.source_name = text(sourceName);
    var.source_type = text(sourceType);
    var.data_type = text(dataType);
    var.format = text(format);
    var.name = text(name);
    var.channel_prefix = hasPrefix ? channelPrefix.c_str() : nullptr;
    return var;
}

bool HdTrapezeFile::Var::operator==(Var const& o) const {
    return std::tie(path, sourceName, sourceType, dataType, format, name, channelPrefix,
                    hasPrefix) == std::tie(o.path, o.sourceName, o.sourceType, o.dataType, o.format,
                                           o.name, o.channelPrefix, o.hasPrefix);
}

bool HdTrapezeFile::operator==(HdTrapezeFile const& o) const {
    return std::tie(product, path, type, compression, pixelType, vars, metadata) ==
           std::tie(o.product, o.path, o.type, o.compression, o.pixelType, o.vars, o.metadata);
}

void HdTrapezeFile::Write(HdTrapezeRenderParam& param, std::string const& failure) const {
    std::vector<trz_render_var> views;
    for (Var const& var : vars) {
        views.push_back(var.View());
    }
    std::vector<char const*> texts;
    for (auto const& [name, value] : metadata) {
        texts.insert(texts.end(), {name.c_str(), value.c_str()});
    }
    char const* const color = "color";
    trz_image image = {};
    image.struct_size = sizeof(image);
    image.type = type;
    image.pixel_type = pixelType;
    image.compression = compression;
    image.color = type == TRZ_IMAGE_PNG ? TRZ_COLOR_SRGB : TRZ_COLOR_LINEAR;
    image.vars = views.data();
    image.var_count = views.size();
    if (views.empty()) {
        image.aovs = &color;
        image.aov_count = 1;
    }
    if (type == TRZ_IMAGE_EXR) {
        image.metadata = texts.data();
        image.metadata_count = texts.size();
    }
    bool const written =
        failure.empty() && trz_image_write(param.Session(), path.c_str(), &image) == TRZ_OK;
    if (!written) {
        std::string const why = failure.empty() ? trz_last_error() : failure;
        param.Warn(product, path + " cannot be written: " + why);
    }
}

std::vector<HdTrapezeRender> HdTrapezePlan(HdRenderSettings const& prim,
                                           HdTrapezeProductContext const& context) {
    HdTrapezeRenderParam& param = context.param;
    std::vector<HdTrapezeRender> renders = {{context.own, {}}};
    double frame = 0.0;
    bool const hasFrame = HdTrapezeCurrentFrame(context.index, &frame);
    std::map<std::string, SdfPath> taken;
    for (auto const& product : prim.GetRenderProducts()) {
        SdfPath const& id = product.productPath;
        auto const refuse = [&](std::string const& why) {
            param.WarnOnce(id, why + "; it is not written");
        };
        if (product.type != _tokens->raster) {
            refuse("productType " + product.type.GetString() + " is not supported, only raster");
            continue;
        }
        HdTrapezeFile file;
        file.product = id;
        file.path = _ExpandFrame(product.name.GetString(), hasFrame ? frame : 0.0);
        std::string const suffix = TfStringToLower(TfGetExtension(file.path));
        if (suffix != "exr" && suffix != "png") {
            refuse(file.path.empty() ? "it has no productName"
                                     : "its productName " + product.name.GetString() +
                                           " must be one that ends in .exr or .png");
            continue;
        }
        file.type = suffix == "png" ? TRZ_IMAGE_PNG : TRZ_IMAGE_EXR;
        std::error_code error;
        std::string const place =
            std::filesystem::weakly_canonical(std::filesystem::absolute(file.path, error), error)
                .string();
        if (!taken.emplace(place, id).second) {
            refuse(file.path + " is already written by " + taken[place].GetString());
            continue;
        }
        auto const* const camera = static_cast<HdTrapezeCamera const*>(
            context.index.GetSprim(HdPrimTypeTokens->camera, product.cameraPath));
        if (!product.cameraPath.IsEmpty() && (!camera || camera->Id() == 0)) {
            refuse("its camera " + product.cameraPath.GetString() + " is no camera");
            continue;
        }
        HdTrapezeSettings settings = context.settings;
        HdTrapezeReadNamespaced(product.namespacedSettings, id, param).Apply(&settings);
        context.host.Apply(&settings);
        HdTrapezeView view;
        view.settings = HdTrapezeFinish(settings);
        view.settings.disable_motion_blur |= product.disableMotionBlur ||
                                             HdTrapezeIsInstantaneous(context.index, id) ||
                                             HdTrapezeIsInstantaneous(context.index, prim.GetId());
        view.settings.disable_defocus |= product.disableDepthOfField ? 1 : 0;
        view.settings.shading_rate *= context.rate;
        view.settings.camera_light = context.own.settings.camera_light && settings.cameraLight;
        view.settings.keep_finer = context.own.settings.keep_finer;
        view.camera = camera ? camera->Id() : context.own.camera;
        std::string const why =
            camera ? _SetImage(product, *camera, &view.settings) : std::string("it has no camera");
        if (!why.empty()) {
            refuse(why);
            continue;
        }
        if (product.renderVars.empty()) {
            param.WarnOnce(id, "its orderedVars is empty; color is written");
            view.AddAov("color");
        } else {
            file.vars = _Vars(product, param.Session(), &view);
            if (file.vars.empty()) {
                refuse("none of its vars can be written");
                continue;
            }
            if (file.type == TRZ_IMAGE_PNG && file.vars.size() > 1) {
                param.WarnOnce(id, "a PNG holds only color: its other vars are left out");
            }
        }
        file.compression = settings.compression;
        file.pixelType = settings.pixelType;
        file.metadata = {
            {"hdtrapeze/version", trz_version()},
            {"hdtrapeze/camera", product.cameraPath.GetString()},
            {"hdtrapeze/frame", hasFrame ? TfStringPrintf("%.10g", frame) : "default"},
            {"hdtrapeze/renderSettings", prim.GetId().GetString()},
            {"hdtrapeze/renderProduct", id.GetString()},
            {"hdtrapeze/complete", "true"},
        };
        auto const shared =
            std::find_if(renders.begin(), renders.end(),
                         [&](HdTrapezeRender const& render) { return render.view.Agrees(view); });
        if (shared == renders.end()) {
            renders.push_back({view, {file}});
        } else {
            for (std::string const& aov : view.aovs) {
                shared->view.AddAov(aov);
            }
            shared->files.push_back(file);
        }
    }
    // The host reads its own image of what was rendered last.
    std::rotate(renders.begin(), renders.begin() + 1, renders.end());
    return renders;
}

PXR_NAMESPACE_CLOSE_SCOPE
