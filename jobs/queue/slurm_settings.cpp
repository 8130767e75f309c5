#include "jobs/queue/slurm_settings.hpp"

#include <optional>

namespace carillon::queue {
namespace {

constexpr std::size_t kMaxWords = 100;

std::vector<std::string> read_texts(base::Object& object, std::string_view key) {
  std::vector<std::string> texts;
  for (base::Entry& entry : object.entries(key, kMaxWords)) {
    if (entry.object || entry.text.find('\0') != std::string::npos) throw InputError(entry.place + ": must be a text");
    texts.push_back(entry.text);
  }
  return texts;
}

}  // namespace

SlurmSettings read_slurm_settings(std::optional<base::Object> object) {
  SlurmSettings settings;
  if (!object) return settings;
  settings.partition = object->string_or("partition", settings.partition);
  settings.account = object->string_or("account", settings.account);
  settings.qos = object->string_or("qos", settings.qos);
  settings.launcher = object->choice_or("launcher", {"mpirun", "srun"}, settings.launcher);
  settings.signal_before_s = object->number_or("signal_before_s", settings.signal_before_s, {0.0, 65536.0});
  settings.poll_s = object->number_or("poll_s", settings.poll_s, {0.0, 86400.0});
  settings.max_ranks = static_cast<int>(object->integer_if("max_ranks", 1, 1 << 20).value_or(settings.max_ranks));
  settings.max_running = static_cast<int>(object->integer_if("max_running", 0, 1 << 20).value_or(settings.max_running));
  settings.max_in_array = static_cast<int>(object->integer_if("max_in_array", 1, 1 << 20).value_or(settings.max_in_array));
  settings.packs = object->boolean_or("pack", settings.packs);
  settings.pack_nodes = static_cast<int>(object->integer_if("pack_nodes", 0, 1 << 20).value_or(settings.pack_nodes));
  settings.pack_cores = static_cast<int>(object->integer_if("pack_cores", 0, 1 << 20).value_or(settings.pack_cores));
  settings.pack_minutes = object->number_or("pack_minutes", settings.pack_minutes, {0.0, 1e6});
  settings.has_pictures = object->boolean_or("pictures", settings.has_pictures);
  settings.options = read_texts(*object, "options");
  settings.prologue = read_texts(*object, "prologue");
  settings.program = object->string_or("program", settings.program);
  object->finish();
  return settings;
}

}  // namespace carillon::queue
