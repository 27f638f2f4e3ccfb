#ifndef HDTRAPEZE_NUMBERS_H
#define HDTRAPEZE_NUMBERS_H

#include "pxr/base/vt/value.h"
#include "pxr/pxr.h"

#include <cstddef>
#include <cstdint>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

/// The numbers that a VtValue holds, an array's or one value's, where it holds numbers. Points into
/// the value, which must outlive it.
struct HdTrapezeNumbers {
    /// TRZ_NUMBERS_*.
    uint32_t type = 0;
    /// Numbers of one element.
    uint32_t width = 0;
    void const* data = nullptr;
    /// Elements.
    size_t count = 0;
    bool isArray = false;

    /// False where the value holds no numbers.
    static bool View(VtValue const& value, HdTrapezeNumbers* out);
};

/// Elements of `width` numbers of the value as floats, in one flat array; empty where it holds
/// others.
std::vector<float> HdTrapezeFloats(VtValue const& value, uint32_t width);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
