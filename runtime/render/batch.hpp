// Many scenes, several at once: the list of carillon-render --jobs.
#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "runtime/base/keys.hpp"
#include "runtime/render/program.hpp"

namespace carillon::render {

/// Reads the runs of a manifest; its paths are relative to it. Throws InputError "file:line: ..." for an invalid manifest, and for two runs
/// that write one file.
std::vector<ProgramOptions> read_manifest(const std::filesystem::path& file);

/// Reference of the keys of a run.
base::KeyTable describe_manifest_keys();

/// Does every run in a process of its own, at most `jobs` at once; a run that fails or crashes stops no other. `work` returns an exit code.
/// Returns 0, or the largest exit code. Throws SystemError if no process can be started. Only for a process with a single thread.
int run_batch(const std::vector<ProgramOptions>& runs, int jobs, const std::function<int(const ProgramOptions&)>& work);

}  // namespace carillon::render
