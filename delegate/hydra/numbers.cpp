#include "numbers.h"

#include "pxr/base/gf/half.h"
#include "pxr/base/gf/matrix3d.h"
#include "pxr/base/gf/matrix3f.h"
#include "pxr/base/gf/matrix4d.h"
#include "pxr/base/gf/matrix4f.h"
#include "pxr/base/gf/quatd.h"
#include "pxr/base/gf/quatf.h"
#include "pxr/base/gf/quath.h"
#include "pxr/base/gf/vec2d.h"
#include "pxr/base/gf/vec2f.h"
#include "pxr/base/gf/vec2h.h"
#include "pxr/base/gf/vec2i.h"
#include "pxr/base/gf/vec3d.h"
#include "pxr/base/gf/vec3f.h"
#include "pxr/base/gf/vec3h.h"
#include "pxr/base/gf/vec3i.h"
#include "pxr/base/gf/vec4d.h"
#include "pxr/base/gf/vec4f.h"
#include "pxr/base/gf/vec4h.h"
#include "pxr/base/gf/vec4i.h"

#include <type_traits>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

template <class T> constexpr uint32_t _Type() {
    if constexpr (std::is_same_v<T, float>) {
        return TRZ_NUMBERS_FLOAT32;
    } else if constexpr (std::is_same_v<T, double>) {
        return TRZ_NUMBERS_FLOAT64;
    } else if constexpr (std::is_same_v<T, GfHalf>) {
        return TRZ_NUMBERS_FLOAT16;
    } else if constexpr (std::is_same_v<T, int>) {
        return TRZ_NUMBERS_INT32;
    } else if constexpr (std::is_same_v<T, unsigned int>) {
        return TRZ_NUMBERS_UINT32;
    } else if constexpr (std::is_same_v<T, int64_t>) {
        return TRZ_NUMBERS_INT64;
    } else if constexpr (std::is_same_v<T, uint64_t>) {
        return TRZ_NUMBERS_UINT64;
    } else {
        static_assert(sizeof(T) == 1, "truth values and bytes");
        return TRZ_NUMBERS_UINT8;
    }
}

// T is made of numbers of the type N and nothing else.
template <class T, class N> bool _View(VtValue const& value, HdTrapezeNumbers* out) {
    static_assert(sizeof(T) % sizeof(N) == 0);
    if (value.IsHolding<VtArray<T>>()) {
        VtArray<T> const& array = value.UncheckedGet<VtArray<T>>();
        *out = {_Type<N>(), sizeof(T) / sizeof(N), array.cdata(), array.size(), true};
        return true;
    }
    if (value.IsHolding<T>()) {
        *out = {_Type<N>(), sizeof(T) / sizeof(N), &value.UncheckedGet<T>(), 1, false};
        return true;
    }
    return false;
}

template <class N, class... T> bool _ViewAny(VtValue const& value, HdTrapezeNumbers* out) {
    return (_View<T, N>(value, out) || ...);
}

template <class N> std::vector<float> _Convert(HdTrapezeNumbers const& numbers) {
    auto const* data = static_cast<N const*>(numbers.data);
    return std::vector<float>(data, data + numbers.count * numbers.width);
}

// Real numbers as floats; others are none.
std::vector<float> _Floats(HdTrapezeNumbers const& numbers) {
    switch (numbers.type) {
    case TRZ_NUMBERS_FLOAT64:
        return _Convert<double>(numbers);
    case TRZ_NUMBERS_FLOAT16:
        return _Convert<GfHalf>(numbers);
    default:
        return {};
    }
}

} // namespace

bool HdTrapezeNumbers::View(VtValue const& value, HdTrapezeNumbers* out) {
    return _ViewAny<float, GfVec3f, float, GfVec2f, GfVec4f, GfQuatf, GfMatrix4f, GfMatrix3f>(
               value, out) ||
           _ViewAny<int, int, GfVec2i, GfVec3i, GfVec4i>(value, out) ||
           _ViewAny<GfHalf, GfHalf, GfVec2h, GfVec3h, GfVec4h, GfQuath>(value, out) ||
           _ViewAny<double, double, GfVec2d, GfVec3d, GfVec4d, GfQuatd, GfMatrix4d, GfMatrix3d>(
               value, out) ||
           _View<bool, bool>(value, out) || _View<unsigned char, unsigned char>(value, out) ||
           _View<unsigned int, unsigned int>(value, out) || _View<int64_t, int64_t>(value, out) ||
           _View<uint64_t, uint64_t>(value, out);
}

HdTrapezeFloatSamples::HdTrapezeFloatSamples(HdTrapezeSamples<VtValue> const& samples,
                                             uint32_t width, VtIntArray const& indices) {
    for (size_t i = 0; i < samples.values.size(); ++i) {
        HdTrapezeNumbers numbers;
        if (!HdTrapezeNumbers::View(samples.values[i], &numbers) || numbers.width != width) {
            continue;
        }
        auto const* floats = static_cast<float const*>(numbers.data);
        size_t count = numbers.count;
        if (numbers.type != TRZ_NUMBERS_FLOAT32) {
            _converted.push_back(_Floats(numbers));
            floats = _converted.back().data();
        }
        if (!indices.empty()) {
            std::vector<float> chosen;
            for (int index : indices) {
                if (index >= 0 && static_cast<size_t>(index) < count) {
                    chosen.insert(chosen.end(), floats + index * width,
                                  floats + (index + 1) * width);
                }
            }
            count = chosen.size() / width;
            _converted.push_back(std::move(chosen));
            floats = _converted.back().data();
        }
        _times.push_back(samples.times[i]);
        _values.push_back(floats);
        _counts.push_back(count);
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
