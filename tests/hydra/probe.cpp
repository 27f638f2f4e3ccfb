// What pickers and viewers of a host see: buffers in its memory, and ids as the host decodes them;
// and a host with several render passes. Python has no access to these, so host.py loads this and
// calls it.

#include "pxr/imaging/hd/camera.h"
#include "pxr/imaging/hd/engine.h"
#include "pxr/imaging/hd/pluginRenderDelegateUniqueHandle.h"
#include "pxr/imaging/hd/renderBuffer.h"
#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/renderPass.h"
#include "pxr/imaging/hd/renderPassState.h"
#include "pxr/imaging/hd/rendererPlugin.h"
#include "pxr/imaging/hd/rendererPluginRegistry.h"
#include "pxr/imaging/hd/task.h"
#include "pxr/imaging/hd/tokens.h"
#include "pxr/usd/usd/prim.h"
#include "pxr/usd/usd/stage.h"
#include "pxr/usdImaging/usdImaging/delegate.h"
#include "pxr/usdImaging/usdImagingGL/engine.h"
#include "pxr/usdImaging/usdImagingGL/renderParams.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <fstream>
#include <iomanip>
#include <map>
#include <memory>
#include <thread>
#include <vector>

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

// A stage in an index of the renderer's.
struct Scene {
    explicit Scene(char const* file)
        : stage(UsdStage::Open(file)),
          delegate(HdRendererPluginRegistry::GetInstance().CreateRenderDelegate(
              TfToken("HdTrapezeRendererPlugin"))),
          index(HdRenderIndex::New(delegate.Get(), {})),
          prims(index.get(), SdfPath::AbsoluteRootPath()) {
        prims.Populate(stage->GetPseudoRoot());
    }

    UsdStageRefPtr const stage;
    HdPluginRenderDelegateUniqueHandle const delegate;
    std::unique_ptr<HdRenderIndex> const index;
    UsdImagingDelegate prims;
};

// Draws a collection into a colour of its own.
class PassTask final : public HdTask {
public:
    PassTask(HdRenderIndex* index, SdfPath const& camera, SdfPathVector const& excluded)
        : HdTask(SdfPath("/task")), _index(index), _camera(camera) {
        HdRprimCollection collection(HdTokens->geometry, HdReprSelector(HdReprTokens->hull));
        collection.SetExcludePaths(excluded);
        HdRenderDelegate* const delegate = index->GetRenderDelegate();
        _pass = delegate->CreateRenderPass(index, collection);
        _buffer = static_cast<HdRenderBuffer*>(
            delegate->CreateBprim(HdPrimTypeTokens->renderBuffer, SdfPath("/color")));
        Resize(48);
    }
    ~PassTask() override { _index->GetRenderDelegate()->DestroyBprim(_buffer); }

    void Sync(HdSceneDelegate*, HdTaskContext*, HdDirtyBits* bits) override {
        _pass->Sync();
        *bits = HdChangeTracker::Clean;
    }
    void Prepare(HdTaskContext*, HdRenderIndex*) override {}
    void Execute(HdTaskContext*) override {
        HdRenderPassAovBinding binding;
        binding.aovName = HdAovTokens->color;
        binding.renderBuffer = _buffer;
        binding.clearValue = VtValue(GfVec4f(0.0f));
        auto const state = std::make_shared<HdRenderPassState>();
        state->SetCamera(
            static_cast<HdCamera const*>(_index->GetSprim(HdPrimTypeTokens->camera, _camera)));
        state->SetFraming(CameraUtilFraming(GfRect2i(GfVec2i(0), 48, 32)));
        state->SetAovBindings({binding});
        _pass->Execute(state, {});
    }
    TfTokenVector const& GetRenderTags() const override {
        static TfTokenVector const tags = {HdRenderTagTokens->geometry};
        return tags;
    }
    bool IsConverged() const { return _pass->IsConverged(); }

    // Of the buffer; the image stays as wide as it is.
    void Resize(int width) { _buffer->Allocate(GfVec3i(width, 32, 1), HdFormatFloat32Vec4, false); }

    // Pixels of the buffer that show something.
    int Covered() const {
        auto const* const pixels = Pixels<GfVec4f>(_buffer);
        auto const count = std::count_if(pixels, pixels + _buffer->GetWidth() * 32,
                                         [](GfVec4f const& pixel) { return pixel[3] > 0.0f; });
        _buffer->Unmap();
        return static_cast<int>(count);
    }

private:
    HdRenderIndex* const _index;
    SdfPath const _camera;
    HdRenderPassSharedPtr _pass;
    HdRenderBuffer* _buffer;
};

// Draws `draws` times, and until all are done; false where that is not in time.
bool Draw(Scene const& scene, std::vector<std::shared_ptr<PassTask>> const& passes, int draws) {
    HdTaskSharedPtrVector tasks(passes.begin(), passes.end());
    HdEngine engine;
    auto const end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    auto const isDone = [](auto const& pass) { return pass->IsConverged(); };
    for (int drawn = 0; drawn < draws || !std::all_of(passes.begin(), passes.end(), isDone);
         ++drawn) {
        if (std::chrono::steady_clock::now() > end) {
            return false;
        }
        engine.Execute(scene.index.get(), &tasks);
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return true;
}

} // namespace

/// Draws a stage by two render passes of one index, of which the second excludes a prim where one
/// is given, `draws` times and until both are done. The number of renders that were started; -1
/// where they are not done in time.
extern "C" __attribute__((visibility("default"))) int
two_passes(char const* file, char const* camera, char const* excluded, int draws) {
    Scene const scene(file);
    SdfPathVector const paths = *excluded ? SdfPathVector{SdfPath(excluded)} : SdfPathVector();
    bool const done =
        Draw(scene,
             {std::make_shared<PassTask>(scene.index.get(), SdfPath(camera), SdfPathVector()),
              std::make_shared<PassTask>(scene.index.get(), SdfPath(camera), paths)},
             draws);
    auto stats = scene.delegate->GetRenderStats();
    return done ? static_cast<int>(stats["renders"].Get<uint64_t>()) : -1;
}

/// Draws a stage into a buffer of a width, and then into one of the image's. The number of pixels
/// that show something at the end; -1 where it is not done in time.
extern "C" __attribute__((visibility("default"))) int after_width(char const* file,
                                                                  char const* camera, int width) {
    Scene const scene(file);
    auto const pass =
        std::make_shared<PassTask>(scene.index.get(), SdfPath(camera), SdfPathVector());
    int covered = 0;
    for (int columns : {width, 48}) {
        pass->Resize(columns);
        covered = Draw(scene, {pass}, 1) ? pass->Covered() : -1;
    }
    return covered;
}

/// Renders a stage through a camera, and writes to a JSON file: what each pair of prim and instance
/// decodes to with its mean pixel (y up); of each AOV its format and its values at the pixel x, y;
/// and the colour there in several formats. Behind all is a colour with this much of `red`.
extern "C" __attribute__((visibility("default"))) int probe(char const* file, char const* camera,
                                                            int width, int height, int x, int y,
                                                            float red, char const* to) {
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
    params.clearColor = GfVec4f(red, 0.5f, 0.75f, 1.0f);
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
