// carillon explore: a web page with playable bodies.
#include "jobs/front/explore/explore.hpp"

#include <fmt/core.h>

#include <cstdio>
#include <map>
#include <string>

#include "jobs/cli/commands.hpp"
#include "jobs/front/explore/serve.hpp"

namespace carillon::cli {
namespace {

void flush() {
  if (std::fflush(stdout) != 0) throw SystemError("the output cannot be written");
}

void print(const explore::Explored& made) {
  for (const std::string& warning : made.warnings) fmt::print(stderr, "carillon: warning: {}\n", show_message(warning));
  for (const explore::PageBank& bank : made.banks)
    if (!bank.change.empty())
      fmt::print("{}: {} of {}: {}; --whole keeps all\n", show(bank.name), format_bytes(static_cast<double>(bank.bytes)),
                 format_bytes(static_cast<double>(bank.full_bytes)), bank.change);
  if (made.has_recording) fmt::print("recording    {:g} s\n", made.duration_s);
  fmt::print("page         {}\nsize         {}\n", show((made.folder / "index.html").string(), 1000),
             format_bytes(static_cast<double>(made.bytes)));
}

base::Json describe(const explore::Explored& made) {
  base::Json root;
  root.set("folder", to_json(made.folder.string())).set("page", to_json((made.folder / "index.html").string())).set("bytes", made.bytes);
  root.set("recording_s", made.has_recording ? base::Json(made.duration_s) : base::Json()).set("warnings", to_json(made.warnings));
  root.set("banks", base::Json::array());
  for (const explore::PageBank& bank : made.banks) {
    base::Json& one = root["banks"].append(base::Json::object());
    one.set("file", to_json(bank.name)).set("bytes", bank.bytes).set("full_bytes", bank.full_bytes);
    one.set("change", bank.change.empty() ? base::Json() : to_json(bank.change));
  }
  return root;
}

}  // namespace

int run_explore(Shared& shared, const ExploreOptions& options) {
  explore::PageOrder order = options.explore;
  std::error_code error;
  const bool is_made = order.subjects.size() == 1 && std::filesystem::is_directory(order.subjects[0], error);
  base::Json root;
  std::map<std::string, std::filesystem::path> originals;
  if (is_made) {
    order.folder = order.subjects[0];
    if (!options.is_serving || !explore::is_explorer(order.folder))
      throw InputError(fmt::format("{}: {}", order.folder.string(),
                                   options.is_serving ? "this folder was not written by carillon explore; give banks or a scene"
                                                      : "a folder can only be served, with --serve; give banks or a scene to write one"));
    root["folder"] = to_json(order.folder.string());
  } else {
    const explore::Explored made = explore::explore(order);
    order.folder = made.folder;
    root = describe(made);
    for (const explore::PageBank& bank : made.banks) originals.emplace(bank.name, bank.original);
    if (!shared.json) print(made);
  }
  if (!options.is_serving) {
    if (shared.json)
      print_json(root);
    else
      fmt::print("to open it   carillon explore {} --serve, or put the folder on any web server\n", show(order.folder.string(), 1000));
    flush();
    return 0;
  }
  (void)explore::serve(order.folder, originals, options.port, [&](const std::string& address) {
    root["address"] = address;
    if (shared.json)
      print_json(root);
    else
      fmt::print("open         {}   (Ctrl-C ends it)\n", address);
    flush();
  });
  return 0;
}

}  // namespace carillon::cli
