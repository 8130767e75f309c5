#include "runtime/base/result.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <iterator>
#include <new>

#include "runtime/base/document.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/json.hpp"

namespace carillon {

void throw_system_error(int error, const std::string& message) {
  if (base::is_full_error(error)) throw DiskFullError(message);
  if (error == ENOMEM) throw MemoryError(message);
  throw SystemError(message);
}

void rethrow_after(const std::string& before) {
  if (before.empty()) throw;
  try {
    throw;
  } catch (const PlacedError& error) {
    throw PlacedError(error.get_place(), before + error.get_message());
  } catch (const CountRefusal& error) {
    throw CountRefusal(before + error.what(), error.get_possible_nodes());
  } catch (const InputError& error) {
    throw InputError(before + error.what());
  } catch (const SolveError& error) {
    throw SolveError(before + error.what());
  } catch (const MemoryError& error) {
    throw MemoryError(before + error.what(), error.get_need_bytes());
  } catch (const DiskFullError& error) {
    throw DiskFullError(before + error.what());
  } catch (const SystemError& error) {
    throw SystemError(before + error.what());
  }
}

namespace base {
namespace {

struct Kind {
  ResultKind kind;
  const char* word;
  int exit_code;
};
constexpr std::array<Kind, 7> kKinds{{{ResultKind::done, "done", 0},
                                      {ResultKind::bad_input, "bad-input", kExitInput},
                                      {ResultKind::no_solution, "no-solution", kExitSolve},
                                      {ResultKind::memory, "memory", kExitSystem},
                                      {ResultKind::disk_full, "disk-full", kExitSystem},
                                      {ResultKind::system, "system", kExitSystem},
                                      {ResultKind::checkpointed, "checkpointed", kExitCheckpointed}}};

const Kind& find_kind(ResultKind kind) { return kKinds[static_cast<std::size_t>(kind)]; }

}  // namespace

const char* to_text(ResultKind kind) { return find_kind(kind).word; }
int get_exit_code(ResultKind kind) { return find_kind(kind).exit_code; }

Result describe_error(const std::exception_ptr& error, const std::string& no_memory) {
  try {
    std::rethrow_exception(error);
  } catch (const PlacedError& e) {
    return {ResultKind::bad_input, e.what(), e.get_place()};
  } catch (const CountRefusal& e) {
    return {.kind = ResultKind::bad_input, .message = e.what(), .possible_nodes = e.get_possible_nodes()};
  } catch (const InputError& e) {
    return {ResultKind::bad_input, e.what()};
  } catch (const SolveError& e) {
    return {ResultKind::no_solution, e.what()};
  } catch (const MemoryError& e) {
    return {ResultKind::memory, e.what(), "", e.get_need_bytes()};
  } catch (const DiskFullError& e) {
    return {ResultKind::disk_full, e.what()};
  } catch (const std::bad_alloc&) {
    return {ResultKind::memory, no_memory};
  } catch (const std::exception& e) {
    return {ResultKind::system, e.what()};
  } catch (...) {
    return {ResultKind::system, "an unknown exception was thrown"};
  }
}

void throw_error(const Result& result) {
  switch (result.kind) {
    case ResultKind::bad_input:
      if (!result.place.empty() && result.message.starts_with(result.place + ": "))
        throw PlacedError(result.place, result.message.substr(result.place.size() + 2));
      if (result.possible_nodes > 0) throw CountRefusal(result.message, result.possible_nodes);
      throw InputError(result.message);
    case ResultKind::no_solution:
      throw SolveError(result.message);
    case ResultKind::memory:
      throw MemoryError(result.message, result.need_bytes);
    case ResultKind::disk_full:
      throw DiskFullError(result.message);
    default:
      throw SystemError(result.message);
  }
}

bool write_result(const std::filesystem::path& file, const Result& result) {
  Json root = Json::object();
  root.set("kind", to_text(result.kind));
  if (!result.message.empty()) root.set("message", result.message);
  if (!result.place.empty()) root.set("place", result.place);
  if (result.need_bytes > 0.0) root.set("need_bytes", decimals(result.need_bytes, 0));
  if (result.possible_nodes > 0) root.set("possible_nodes", result.possible_nodes);
  root.set("resumable", result.is_resumable);
  try {
    write_file(file, root.text());
    return true;
  } catch (const SystemError&) {
    return false;
  }
}

std::optional<Result> read_result(const std::filesystem::path& file) {
  constexpr std::uint64_t kMaxBytes = 1 << 20;
  constexpr std::int64_t kMaxCount = 1'000'000'000'000'000;
  try {
    Object root = parse_document(read_file(file, "result", kMaxBytes), file).root();
    const std::string word = root.string("kind");
    const auto kind = std::find_if(kKinds.begin(), kKinds.end(), [&](const Kind& known) { return word == known.word; });
    if (kind == kKinds.end()) return std::nullopt;
    Result result;
    result.kind = kind->kind;
    result.message = root.string_or("message", "");
    result.place = root.string_or("place", "");
    result.need_bytes = root.number_or("need_bytes", 0.0);
    result.possible_nodes = root.has("possible_nodes") ? root.integer("possible_nodes", 1, kMaxCount) : 0;
    result.is_resumable = root.boolean_or("resumable", false);
    return result;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

}  // namespace base
}  // namespace carillon
