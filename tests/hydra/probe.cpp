// What pickers and viewers of a host see: buffers in its memory, and ids as the host decodes them.
// Python has no access to either, so host.py loads this and calls it.

#include "pxr/imaging/hd/renderBuffer.h"
#include "pxr/imaging/hd/tokens.h"
#include "pxr/usd/usd/prim.h"
#include "pxr/usd/usd/stage.h"
#include "pxr/usdImaging/usdImagingGL/engine.h"
#include "pxr/usdImaging/usdImagingGL/renderParams.h"

#include <chrono>
#include <cstdint>
#include <fstream>
#include <iomanip>
#include <map>
#include <thread>

PXR_NAMESPACE_USING_DIRECTIVE

namespace {

struct Place {
    double x = 0.0, y = 0.0;
    int count = 0;
};

template <class T> T const* Pixels(HdRenderBuffer* buffer) {
    return static_cast<T const*>(buffer->Map());
}

// The colour of a pixel in a format that the host chose.
void WriteColor(std::ostream& out, HdRenderBuffer* buffer, HdFormat format, size_t pixel) {
    GfVec3i const size(buffer->GetWidth(), buffer->GetHeight(), 1);
    buffer->Allocate(size, format, false);
    buffer->Resolve();
    auto const* bytes = Pixels<uint8_t>(buffer) + pixel * HdDataSizeOfFormat(format);
    out << "[";
    for (int c = 0; c < 4; ++c) {
        double value = 0.0;
        if (format == HdFormatUNorm8Vec4) {
            value = bytes[c] / 255.0;
        } else if (format == HdFormatFloat16Vec4) {
            value = reinterpret_cast<GfHalf const*>(bytes)[c];
        } else {
            value = reinterpret_cast<float const*>(bytes)[c];
        }
        out << (c ? ", " : "") << value;
    }
    out << "]";
    buffer->Unmap();
}

} // namespace

/// Renders a stage through a camera, and writes to a JSON file: what each pair of prim and instance
/// decodes to with its mean pixel (y up); of each AOV its format and its values at the pixel x, y;
/// and the colour there in several formats.
extern "C" __attribute__((visibility("default"))) int
probe(char const* file, char const* camera, int width, int height, int x, int y, char const* to) {
    UsdStageRefPtr const stage = UsdStage::Open(file);
    UsdImagingGLEngine::Parameters parameters;
    parameters.gpuEnabled = false;
    parameters.rendererPluginId = TfToken("HdTrapezeRendererPlugin");
    UsdImagingGLEngine engine(parameters);
    TfTokenVector const aovs = {
        HdAovTokens->color,     HdAovTokens->depth,
        HdAovTokens->primId,    HdAovTokens->instanceId,
        HdAovTokens->elementId, HdAovTokens->normal,
        HdAovTokens->Neye,      HdAovTokensMakePrimvar(TfToken("st")),
        TfToken("cost"),        TfToken("motionVectors"),
        TfToken("sampleCount"),
    };
    engine.SetRendererAovs(aovs);
    engine.SetRendererSetting(TfToken("trapeze:samples"), VtValue(4));
    engine.SetCameraPath(SdfPath(camera));
    engine.SetFraming(CameraUtilFraming(GfRect2i(GfVec2i(0), width, height)));
    engine.SetRenderBufferSize(GfVec2i(width, height));
    UsdImagingGLRenderParams params;
    params.frame = UsdTimeCode(1.0);
    params.clearColor = GfVec4f(0.25f, 0.5f, 0.75f, 1.0f);
    auto const end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    do {
        engine.Render(stage->GetPseudoRoot(), params);
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    } while (!engine.IsConverged() && std::chrono::steady_clock::now() < end);

    std::ofstream out(to);
    out << std::setprecision(9) << "{\"aovs\": {";
    size_t const pixel = size_t(y) * width + x;
    bool first = true;
    for (TfToken const& aov : aovs) {
        HdRenderBuffer* const buffer = engine.GetAovRenderBuffer(aov);
        if (!buffer) {
            continue;
        }
        buffer->Resolve();
        HdFormat const format = buffer->GetFormat();
        size_t const count = HdGetComponentCount(format);
        auto const* const bytes = Pixels<uint8_t>(buffer) + pixel * HdDataSizeOfFormat(format);
        out << (first ? "" : ", ") << "\"" << aov << "\": {\"width\": " << buffer->GetWidth()
            << ", \"height\": " << buffer->GetHeight() << ", \"format\": " << int(format)
            << ", \"value\": [";
        for (size_t c = 0; c < count; ++c) {
            HdFormat const component = HdGetComponentFormat(format);
            out << (c ? ", " : "");
            if (component == HdFormatInt32) {
                out << reinterpret_cast<int32_t const*>(bytes)[c];
            } else if (component == HdFormatFloat16) {
                out << float(reinterpret_cast<GfHalf const*>(bytes)[c]);
            } else {
                out << reinterpret_cast<float const*>(bytes)[c];
            }
        }
        out << "]}";
        buffer->Unmap();
        first = false;
    }
    out << "}, \"hits\": [";
    HdRenderBuffer* const prims = engine.GetAovRenderBuffer(HdAovTokens->primId);
    HdRenderBuffer* const instances = engine.GetAovRenderBuffer(HdAovTokens->instanceId);
    auto const* const primIds = Pixels<int32_t>(prims);
    auto const* const instanceIds = Pixels<int32_t>(instances);
    std::map<std::pair<int, int>, Place> places;
    for (int row = 0; row < height; ++row) {
        for (int column = 0; column < width; ++column) {
            size_t const i = size_t(row) * width + column;
            Place& place = places[{primIds[i], instanceIds[i]}];
            place.x += column + 0.5;
            place.y += row + 0.5;
            ++place.count;
        }
    }
    prims->Unmap();
    instances->Unmap();
    first = true;
    for (auto const& [ids, place] : places) {
        SdfPath path, instancer;
        int index = -1;
        HdInstancerContext context;
        if (!engine.DecodeIntersection(ids.first, ids.second, &path, &instancer, &index,
                                       &context)) {
            continue;
        }
        out << (first ? "" : ", ") << "{\"path\": \"" << path << "\", \"instancer\": \""
            << instancer << "\", \"index\": " << index << ", \"x\": " << place.x / place.count
            << ", \"y\": " << place.y / place.count << ", \"count\": " << place.count
            << ", \"context\": [";
        for (size_t i = 0; i < context.size(); ++i) {
            out << (i ? ", " : "") << "[\"" << context[i].first << "\", " << context[i].second
                << "]";
        }
        out << "]}";
        first = false;
    }
    out << "], \"colors\": [";
    HdRenderBuffer* const color = engine.GetAovRenderBuffer(HdAovTokens->color);
    WriteColor(out, color, HdFormatFloat32Vec4, pixel);
    out << ", ";
    WriteColor(out, color, HdFormatFloat16Vec4, pixel);
    out << ", ";
    WriteColor(out, color, HdFormatUNorm8Vec4, pixel);
    out << "]}";
    return out.good() ? 0 : 1;
}
