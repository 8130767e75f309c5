// Loads the module with Simbody and creates mechanisms.
#include "runtime/physics/joints/mechanism.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <filesystem>
#include <mutex>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/physics/joints/engine.hpp"

namespace carillon::joints {
namespace {

namespace fs = std::filesystem;

/// Folder of the program or library that contains this code.
fs::path find_own_folder() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&find_own_folder), &info) == 0 || info.dli_fname == nullptr) return ".";
  std::error_code error;
  // The name of a program found along PATH has no folder.
  const bool has_folder = std::string_view(info.dli_fname).find('/') != std::string_view::npos;
  const fs::path file = has_folder ? fs::canonical(info.dli_fname, error) : fs::read_symlink("/proc/self/exe", error);
  return error ? fs::path(".") : file.parent_path();
}

MakeMechanism load_engine() {
  const fs::path own = find_own_folder();
  std::string tried;
  for (const fs::path& file :
       {own / kEngineFile, own / ".." / CARILLON_LIBDIR / "carillon" / kEngineFile, own / "carillon" / kEngineFile}) {
    std::error_code error;
    if (!fs::exists(file, error)) {
      tried += fmt::format("{}{}", tried.empty() ? "" : ", ", file.lexically_normal().string());
      continue;
    }
    void* module = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (module == nullptr)
      throw SystemError(fmt::format("joints need Simbody, and {} cannot be loaded: {}; install libsimbody3.7 (Debian)",
                                    file.lexically_normal().string(), dlerror()));
    if (void* found = dlsym(module, kEngineName); found != nullptr) return reinterpret_cast<MakeMechanism>(found);
    throw SystemError(fmt::format("{} belongs to another version of Carillon; install both from one build", file.string()));
  }
  throw SystemError(fmt::format("joints need the module {}, not found at {}; install it with the programs", kEngineFile, tried));
}

}  // namespace

std::unique_ptr<Mechanism> make_mechanism(const std::vector<Member>& members, const std::vector<Joint>& joints, const Vec3& gravity) {
  static std::mutex mutex;
  static MakeMechanism make = nullptr;
  {
    const std::lock_guard lock(mutex);
    if (make == nullptr) make = load_engine();
  }
  return std::unique_ptr<Mechanism>(make(members, joints, gravity));
}

}  // namespace carillon::joints
