#include "renderBuffer.h"

#include "hdtrapeze.h"
#include "numbers.h"
#include "renderParam.h"

#include "pxr/base/gf/half.h"

#include <algorithm>
#include <cmath>
#include <cstring>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Writes one component of a pixel.
void _Write(char* out, HdFormat component, double value) {
    switch (component) {
    case HdFormatFloat32: {
        float const v = static_cast<float>(value);
        std::memcpy(out, &v, sizeof(v));
        break;
    }
    case HdFormatFloat16: {
        GfHalf const v(static_cast<float>(value));
        std::memcpy(out, &v, sizeof(v));
        break;
    }
    case HdFormatInt32: {
        int32_t const v = static_cast<int32_t>(value);
        std::memcpy(out, &v, sizeof(v));
        break;
    }
    case HdFormatUNorm8:
        *reinterpret_cast<unsigned char*>(out) =
            static_cast<unsigned char>(std::lround(std::clamp(value, 0.0, 1.0) * 255.0));
        break;
    case HdFormatSNorm8:
        *reinterpret_cast<signed char*>(out) =
            static_cast<signed char>(std::lround(std::clamp(value, -1.0, 1.0) * 127.0));
        break;
    default:
        break;
    }
}

// The numbers of a clear value; none where it has none.
std::vector<double> _ClearNumbers(VtValue const& clear) {
    std::vector<double> numbers;
    HdTrapezeNumbers view;
    if (!HdTrapezeNumbers::View(clear, &view) || view.isArray) {
        return numbers;
    }
    for (uint32_t i = 0; i < view.width; ++i) {
        switch (view.type) {
        case TRZ_NUMBERS_FLOAT32:
            numbers.push_back(static_cast<float const*>(view.data)[i]);
            break;
        case TRZ_NUMBERS_FLOAT64:
            numbers.push_back(static_cast<double const*>(view.data)[i]);
            break;
        case TRZ_NUMBERS_INT32:
            numbers.push_back(static_cast<int32_t const*>(view.data)[i]);
            break;
        default:
            return {};
        }
    }
    return numbers;
}

} // namespace

void HdTrapezeRenderBuffer::Bind(HdTrapezeRenderParam const* param, std::string const& aov,
                                 VtValue const& clear, GfVec2i const& origin) {
    std::lock_guard<std::mutex> lock(_mutex);
    if (param == _param && aov == _aov && clear == _clear && origin == _origin) {
        return;
    }
    _param = param;
    _aov = aov;
    _clear = clear;
    _origin = origin;
    _generation = 0;
    _Clear();
}

void HdTrapezeRenderBuffer::Unbind() {
    std::lock_guard<std::mutex> lock(_mutex);
    _param = nullptr;
}

void HdTrapezeRenderBuffer::Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam,
                                 HdDirtyBits* dirtyBits) {
    HdRenderBuffer::Sync(delegate, renderParam, dirtyBits);
}

void HdTrapezeRenderBuffer::Finalize(HdRenderParam* renderParam) {
    HdRenderBuffer::Finalize(renderParam);
    Unbind();
}

bool HdTrapezeRenderBuffer::Allocate(GfVec3i const& dimensions, HdFormat format, bool) {
    std::lock_guard<std::mutex> lock(_mutex);
    _Deallocate();
    if (dimensions[0] < 0 || dimensions[1] < 0 || dimensions[2] != 1 ||
        HdDataSizeOfFormat(format) == 0) {
        TF_WARN("Trapeze: a render buffer of %d x %d x %d pixels in format %d cannot be",
                dimensions[0], dimensions[1], dimensions[2], static_cast<int>(format));
        return false;
    }
    _width = dimensions[0];
    _height = dimensions[1];
    _format = format;
    _data.resize(size_t(_width) * _height * HdDataSizeOfFormat(format));
    _Clear();
    return true;
}

// With the mutex held, as all that begins with an underscore.
void HdTrapezeRenderBuffer::_Deallocate() {
    _width = 0;
    _height = 0;
    _format = HdFormatInvalid;
    _data.clear();
    _generation = 0;
    _samples = 0;
    _complete = false;
}

void HdTrapezeRenderBuffer::_Clear() {
    std::vector<double> const clear = _ClearNumbers(_clear);
    size_t const components = HdGetComponentCount(_format);
    HdFormat const component = HdGetComponentFormat(_format);
    size_t const pixel = HdDataSizeOfFormat(_format);
    if (_data.empty() || clear.empty()) {
        std::fill(_data.begin(), _data.end(), 0);
        return;
    }
    std::vector<char> one(pixel, 0);
    for (size_t c = 0; c < components && c < clear.size(); ++c) {
        _Write(one.data() + c * (pixel / components), component, clear[c]);
    }
    for (size_t i = 0; i < _data.size(); i += pixel) {
        std::memcpy(_data.data() + i, one.data(), pixel);
    }
}

void* HdTrapezeRenderBuffer::Map() {
    std::lock_guard<std::mutex> lock(_mutex);
    if (_mapped++ == 0) {
        _Update();
    }
    return _data.data();
}

void HdTrapezeRenderBuffer::Unmap() { --_mapped; }

void HdTrapezeRenderBuffer::Resolve() {
    std::lock_guard<std::mutex> lock(_mutex);
    if (_mapped == 0) {
        _Update();
    }
}

bool HdTrapezeRenderBuffer::IsConverged() const {
    std::lock_guard<std::mutex> lock(_mutex);
    return !_param || _param->Progress().view_converged;
}

// Copies what was rendered, where that is more than what is there.
void HdTrapezeRenderBuffer::_Update() {
    if (!_param || _data.empty()) {
        return;
    }
    trz_session* const session = _param->Session();
    trz_progress const progress = _param->Progress();
    uint64_t const generation = progress.view_readable;
    if (generation == 0) {
        return;
    }
    // A render that has not been everywhere yet leaves the one before it on the screen, and all
    // that there is once it has ended.
    bool const ended = progress.state != TRZ_STATE_PREPARING &&
                       progress.state != TRZ_STATE_RENDERING && progress.state != TRZ_STATE_PAUSED;
    if (progress.state == TRZ_STATE_PREPARING || (!ended && progress.samples_done == 0) ||
        (generation == _generation && progress.samples_done == _samples && ended == _complete)) {
        return;
    }
    trz_aov_desc desc = {};
    desc.struct_size = sizeof(desc);
    if (trz_aov_describe(session, _aov.c_str(), &desc) != TRZ_OK) {
        return;
    }
    std::vector<char> values(size_t(desc.width) * desc.height * desc.components * 4);
    if (trz_aov_read(session, _aov.c_str(), values.data(), values.size()) != TRZ_OK) {
        return; // another render began in between
    }
    _generation = generation;
    _samples = progress.samples_done;
    _complete = ended;

    size_t const components = HdGetComponentCount(_format);
    HdFormat const component = HdGetComponentFormat(_format);
    size_t const size = HdDataSizeOfFormat(component);
    size_t const given = desc.components;
    std::vector<double> const clear = _ClearNumbers(_clear);
    bool const over = _aov == "color" && given == 4 && clear.size() >= 3 &&
                      std::any_of(clear.begin(), clear.end(), [](double c) { return c != 0.0; });
    _Clear();
    for (unsigned int row = 0; row < _height; ++row) {
        int64_t const y = int64_t(_height) - 1 - row + _origin[1] - desc.origin_y;
        if (y < 0 || y >= desc.height) {
            continue;
        }
        for (unsigned int column = 0; column < _width; ++column) {
            int64_t const x = int64_t(column) + _origin[0] - desc.origin_x;
            if (x < 0 || x >= desc.width) {
                continue;
            }
            char const* const from = values.data() + (size_t(y) * desc.width + x) * given * 4;
            char* const to = _data.data() + (size_t(row) * _width + column) * components * size;
            double pixel[16] = {};
            for (size_t c = 0; c < given && c < 16; ++c) {
                if (desc.format == TRZ_FORMAT_INT32) {
                    int32_t v;
                    std::memcpy(&v, from + c * 4, 4);
                    pixel[c] = v;
                } else {
                    float v;
                    std::memcpy(&v, from + c * 4, 4);
                    pixel[c] = v;
                }
            }
            if (over) {
                double const behind = 1.0 - pixel[3];
                for (size_t c = 0; c < 4 && c < clear.size(); ++c) {
                    pixel[c] += behind * clear[c];
                }
            } else if (given == 3) {
                pixel[3] = 1.0;
            }
            for (size_t c = 0; c < components; ++c) {
                _Write(to + c * size, component, pixel[c]);
            }
        }
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
