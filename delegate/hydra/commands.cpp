#include "commands.h"

#include "numbers.h"

#include "pxr/base/tf/diagnostic.h"
#include "pxr/base/tf/pathUtils.h"
#include "pxr/base/tf/staticTokens.h"
#include "pxr/base/tf/stringUtils.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

TF_DEFINE_PRIVATE_TOKENS(_tokens, (dumpScene)(saveImage)(path));

// Whether a call was a success; otherwise warns.
bool _IsDone(trz_result result) {
    if (result != TRZ_OK) {
        TF_WARN("Trapeze: %s (%s)", trz_last_error(), trz_result_name(result));
    }
    return result == TRZ_OK;
}

bool _SaveImage(trz_session* session, std::string const& path) {
    if (TfStringToLower(TfGetExtension(path)) != "exr") {
        TF_WARN("Trapeze: %s must end in .exr", path.c_str());
        return false;
    }
    auto image = HdTrapezeStruct<trz_image>();
    image.type = TRZ_IMAGE_EXR;
    image.pixel_type = TRZ_PIXEL_FLOAT;
    image.compression = TRZ_COMPRESSION_ZIP;
    return _IsDone(trz_image_write(session, path.c_str(), &image));
}

} // namespace

HdCommandDescriptors HdTrapezeCommands() {
    HdCommandArgDescriptors const path = {{_tokens->path, VtValue(std::string())}};
    return {
        HdCommandDescriptor(_tokens->dumpScene, "Write the scene as text", path),
        HdCommandDescriptor(_tokens->saveImage, "Save the image with its AOVs as EXR", path),
    };
}

bool HdTrapezeRunCommand(trz_session* session, TfToken const& command, HdCommandArgs const& args) {
    auto const found = args.find(_tokens->path.GetString());
    std::string const path =
        found == args.end() ? std::string() : found->second.GetWithDefault<std::string>();
    if (!session || path.empty()) {
        TF_WARN("Trapeze: the command %s needs a path", command.GetText());
        return false;
    }
    if (command == _tokens->dumpScene) {
        return _IsDone(trz_scene_write(session, path.c_str()));
    }
    if (command == _tokens->saveImage) {
        return _SaveImage(session, path);
    }
    TF_WARN("Trapeze: there is no command %s", command.GetText());
    return false;
}

PXR_NAMESPACE_CLOSE_SCOPE
