#ifndef HDTRAPEZE_COMMANDS_H
#define HDTRAPEZE_COMMANDS_H

#include "hdtrapeze.h"

#include "pxr/imaging/hd/command.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// What a host may ask of the renderer beside rendering, as menus show it:
/// dumpScene writes the scene as the renderer understands it, as text, to the file `path`;
/// saveImage writes what was rendered, all AOVs, to the EXR `path`, as floats.
HdCommandDescriptors HdTrapezeCommands();

/// Runs a command. Where it fails, gives a warning and false.
bool HdTrapezeRunCommand(trz_session* session, TfToken const& command, HdCommandArgs const& args);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
