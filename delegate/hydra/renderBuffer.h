#ifndef HDTRAPEZE_RENDER_BUFFER_H
#define HDTRAPEZE_RENDER_BUFFER_H

#include "hdtrapeze.h"

#include "pxr/base/gf/vec2i.h"
#include "pxr/base/gf/vec3i.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/renderBuffer.h"
#include "pxr/pxr.h"

#include <atomic>
#include <mutex>
#include <string>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

class HdTrapezeRenderParam;

/// A buffer of the host's that shows one AOV: rows from the bottom up, in the format that the host
/// chose. What was rendered is copied when the host maps it.
class HdTrapezeRenderBuffer final : public HdRenderBuffer {
public:
    explicit HdTrapezeRenderBuffer(SdfPath const& id) : HdRenderBuffer(id) {}

    /// What it is to show: an AOV of the session, over `clear`. `origin` is the pixel of the image,
    /// y down from its top left, that the buffer's top left is.
    void Bind(HdTrapezeRenderParam const* param, std::string const& aov, VtValue const& clear,
              GfVec2i const& origin);

    /// Ends Bind: from now on it keeps what it has. Before the session goes.
    void Finalize(HdRenderParam* renderParam) override;
    bool Allocate(GfVec3i const& dimensions, HdFormat format, bool multiSampled) override;
    unsigned int GetWidth() const override { return _shown.width; }
    unsigned int GetHeight() const override { return _shown.height; }
    unsigned int GetDepth() const override { return 1; }
    HdFormat GetFormat() const override { return _format; }
    bool IsMultiSampled() const override { return false; }
    void* Map() override;
    void Unmap() override { --_mapped; }
    bool IsMapped() const override { return _mapped > 0; }
    void Resolve() override;
    bool IsConverged() const override;

private:
    void _Deallocate() override;
    void _Update();

    mutable std::mutex _mutex;
    std::vector<char> _data;
    HdFormat _format = HdFormatInvalid;
    std::atomic<int> _mapped{0};

    HdTrapezeRenderParam const* _param = nullptr;
    std::string _aov;
    VtValue _clear;
    GfVec2i _origin{0, 0};
    // The buffer as the library sees it.
    trz_buffer _shown = {};
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
