#include "numbers.h"

#include "pxr/imaging/hd/types.h"

#include <map>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Integers of 64 bits, which Hydra's own functions leave out.
template <class T> bool _View(VtValue const& value, uint32_t type, HdTrapezeNumbers* out) {
    if (value.IsHolding<VtArray<T>>()) {
        auto const& array = value.UncheckedGet<VtArray<T>>();
        *out = {type, 1, array.cdata(), array.size()};
        return true;
    }
    if (value.IsHolding<T>()) {
        *out = {type, 1, &value.UncheckedGet<T>(), 1};
        return true;
    }
    return false;
}

} // namespace

bool HdTrapezeNumbers::View(VtValue const& value, HdTrapezeNumbers* out) {
    static std::map<HdType, uint32_t> const types = {
        {HdTypeFloat, TRZ_NUMBERS_FLOAT32},     {HdTypeDouble, TRZ_NUMBERS_FLOAT64},
        {HdTypeHalfFloat, TRZ_NUMBERS_FLOAT16}, {HdTypeInt32, TRZ_NUMBERS_INT32},
        {HdTypeUInt32, TRZ_NUMBERS_UINT32},     {HdTypeUInt8, TRZ_NUMBERS_UINT8},
        {HdTypeBool, TRZ_NUMBERS_UINT8},
    };
    HdTupleType const tuple = HdGetValueTupleType(value);
    auto const found = types.find(HdGetComponentType(tuple.type));
    if (found == types.end()) {
        return _View<int64_t>(value, TRZ_NUMBERS_INT64, out) ||
               _View<uint64_t>(value, TRZ_NUMBERS_UINT64, out);
    }
    *out = {found->second, static_cast<uint32_t>(HdGetComponentCount(tuple.type)),
            HdGetValueData(value), tuple.count};
    return true;
}

PXR_NAMESPACE_CLOSE_SCOPE
