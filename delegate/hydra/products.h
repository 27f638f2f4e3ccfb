#ifndef HDTRAPEZE_PRODUCTS_H
#define HDTRAPEZE_PRODUCTS_H

#include "view.h"

#include "pxr/imaging/hd/renderSettings.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <map>
#include <string>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

class HdRenderIndex;
class HdTrapezeRenderParam;

/// The file of a RenderProduct.
struct HdTrapezeFile {
    SdfPath product;
    std::string path;
    uint32_t type = TRZ_IMAGE_EXR;
    uint32_t compression = TRZ_COMPRESSION_ZIP;
    uint32_t pixelType = TRZ_PIXEL_HALF;
    /// Texts of trz_render_var by its fields' order; empty ones are not authored.
    struct Var {
        std::string path, sourceName, sourceType, dataType, format, name, channelPrefix;
        bool hasPrefix = false;
        trz_render_var View() const;
        bool operator==(Var const& other) const;
    };
    std::vector<Var> vars;
    std::map<std::string, std::string> metadata;

    bool operator==(HdTrapezeFile const& other) const;

    /// Writes what the session has rendered, where there is no failure. Where that cannot be, the
    /// product gets a warning.
    void Write(HdTrapezeRenderParam& param, std::string const& failure) const;
};

/// One render, and the files that are written of it.
struct HdTrapezeRender {
    HdTrapezeView view;
    std::vector<HdTrapezeFile> files;

    bool operator==(HdTrapezeRender const& other) const {
        return view == other.view && files == other.files;
    }
};

/// What the products of a host's render start from.
struct HdTrapezeProductContext {
    HdRenderIndex const& index;
    HdTrapezeRenderParam& param;
    /// Of the host's own image.
    HdTrapezeView const& own;
    HdTrapezeSettingsLayer const& host;
    /// The settings prim's settings and the library's.
    HdTrapezeSettings settings;
    /// Factor on the shading rate.
    float rate = 1.0f;
};

/// The renders of a RenderSettings prim's products, and the host's own at the end. Products that
/// agree with another's image, or the host's, share its render. Of what cannot be there is a
/// warning, and the rest is rendered.
std::vector<HdTrapezeRender> HdTrapezePlan(HdRenderSettings const& prim,
                                           HdTrapezeProductContext const& context);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
