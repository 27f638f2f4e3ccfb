#include "renderBuffer.h"

#include "numbers.h"
#include "renderParam.h"

#include <map>
#include <new>
#include <optional>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// TRZ_COMPONENT_* of a format's components, where they are supported.
std::optional<uint32_t> _Component(HdFormat format) {
    static std::map<HdFormat, uint32_t> const components = {
        {HdFormatFloat32, TRZ_COMPONENT_FLOAT32},
        // A depth, and as many bytes with a stencil, which stays 0.
        {HdFormatFloat32UInt8, TRZ_COMPONENT_FLOAT32},
        {HdFormatFloat16, TRZ_COMPONENT_FLOAT16},
        {HdFormatInt32, TRZ_COMPONENT_INT32},
        {HdFormatUNorm8, TRZ_COMPONENT_UNORM8},
        {HdFormatSNorm8, TRZ_COMPONENT_SNORM8},
    };
    auto const found = components.find(HdGetComponentFormat(format));
    return found == components.end() ? std::nullopt : std::optional<uint32_t>(found->second);
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
    _shown.filled = 0;
    _shown.render = 0;
}

void HdTrapezeRenderBuffer::Finalize(HdRenderParam* renderParam) {
    HdRenderBuffer::Finalize(renderParam);
    std::lock_guard<std::mutex> lock(_mutex);
    _param = nullptr;
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
    // Neither number is above 2^31, and no format has 2^6 bytes or more.
    uint64_t const pixels = uint64_t(dimensions[0]) * uint64_t(dimensions[1]);
    try {
        if (pixels > _data.max_size() / HdDataSizeOfFormat(format)) {
            throw std::bad_alloc();
        }
        _data.resize(pixels * HdDataSizeOfFormat(format));
    } catch (std::bad_alloc const&) {
        TF_WARN("Trapeze: there is no memory for a render buffer of %d x %d pixels", dimensions[0],
                dimensions[1]);
        return false;
    }
    if (!_Component(format)) {
        TF_WARN("Trapeze: pixels of format %d are not supported; <%s> stays black",
                static_cast<int>(format), GetId().GetText());
    }
    _format = format;
    _shown.width = dimensions[0];
    _shown.height = dimensions[1];
    return true;
}

// With the mutex held, as all that begins with an underscore.
void HdTrapezeRenderBuffer::_Deallocate() {
    _format = HdFormatInvalid;
    _data.clear();
    _shown = {};
}

void* HdTrapezeRenderBuffer::Map() {
    std::lock_guard<std::mutex> lock(_mutex);
    if (_mapped++ == 0) {
        _Update();
    }
    return _data.data();
}

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
    std::optional<uint32_t> const component = _Component(_format);
    if (!_param || _data.empty() || !component) {
        return;
    }
    bool const hasStencil = _format == HdFormatFloat32UInt8;
    VtValue const value = _clear.IsHolding<HdDepthStencilType>()
                              ? VtValue(_clear.UncheckedGet<HdDepthStencilType>().first)
                              : _clear;
    HdTrapezeNumbers clear;
    bool const isClear = !value.IsArrayValued() && HdTrapezeNumbers::View(value, &clear);
    _shown.struct_size = sizeof(_shown);
    _shown.component = *component;
    _shown.components = hasStencil ? 2 : static_cast<uint32_t>(HdGetComponentCount(_format));
    _shown.bottom_up = 1;
    _shown.origin[0] = _origin[0];
    _shown.origin[1] = _origin[1];
    _shown.clear = clear.data;
    _shown.clear_type = clear.type;
    _shown.clear_count = isClear ? clear.width : 0;
    _shown.data = _data.data();
    _shown.bytes = _data.size();
    // Where the session failed, or has no memory, what is there stays.
    trz_view_show(_param->Session(), _aov.c_str(), &_shown);
}

PXR_NAMESPACE_CLOSE_SCOPE
