#include "precompute/simulation/checkpoint.hpp"

#include <fmt/core.h>

#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "precompute/comm/exchange.hpp"
#include "precompute/run/io/fingerprint.hpp"
#include "runtime/base/bytes.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"

namespace carillon::simulation {
namespace {

using Hash = base::Sha256::Hash;

constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 38;

struct Head {
  char magic[8];
  Hash identity;
  std::int32_t ranks;
};
constexpr char kMagic[8] = {'C', 'A', 'R', 'S', 'I', 'M', '0', '3'};

std::string_view view(std::span<const std::byte> bytes) { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }

Hash calc_seal(std::span<const std::byte> bytes) {
  base::Sha256 sum;
  sum.add(view(bytes));
  return sum.finish();
}

/// File contents on rank 0.
struct Content {
  SimulationState state;
  std::vector<std::int64_t> sizes;  // (ranks) bytes of their sound state
  std::vector<std::byte> sounds;    // of all ranks
};

Content read(const std::filesystem::path& file, const Hash& identity, int ranks) {
  const auto refuse = [&](const std::string& why) {
    throw InputError(fmt::format("{}: the checkpoint {}; remove it, or give another file", file.string(), why));
  };
  const std::string text = base::read_file(file, "checkpoint", kMaxBytes);
  std::span<const std::byte> from = std::as_bytes(std::span(text));
  if (from.size() < sizeof(Head) + sizeof(Hash)) refuse("is cut off");
  const std::span<const std::byte> content = from.first(from.size() - sizeof(Hash));
  std::span<const std::byte> end = from.subspan(content.size());
  from = content;
  const auto head = base::take<Head>(from);
  if (std::memcmp(head.magic, kMagic, sizeof kMagic) != 0) refuse("is not a simulation checkpoint");
  if (base::take<Hash>(end) != calc_seal(content)) refuse("is cut off or changed");
  if (head.identity != identity) refuse("is of another job, of other meshes or of another version of the program");
  if (head.ranks != ranks) refuse(fmt::format("is of {} ranks, and there are {}", head.ranks, ranks));
  Content result;
  result.state.books = base::take_list<transient::EnergyBook>(from);
  result.state.motion = base::take_list<std::byte>(from);
  result.state.contacts = base::take_list<std::byte>(from);
  result.sizes = base::take_list<std::int64_t>(from);
  result.sounds = base::take_list<std::byte>(from);
  return result;
}

}  // namespace

Hash find_identity(const std::string& job_text, const transient::Assembly& assembly) {
  base::Sha256 sum;
  sum.add(job_text);
  sum.add(io::find_program_version());
  sum.add(view(std::as_bytes(std::span(assembly.nodes_m))));
  sum.add(view(std::as_bytes(std::span(assembly.tets))));
  return sum.finish();
}

void save_checkpoint(const comm::Communicator& comm, const std::filesystem::path& file, const Hash& identity,
                     const SimulationState& state) {
  const std::vector<std::int64_t> sizes = comm.all_gather(std::vector<std::int64_t>{static_cast<std::int64_t>(state.sound.size())});
  const std::vector<std::byte> sounds = comm::gather(comm, state.sound);
  comm.agree([&] {
    if (!comm.is_root()) return;
    Head head{};
    std::memcpy(head.magic, kMagic, sizeof kMagic);
    head.identity = identity;
    head.ranks = comm.size();
    std::vector<std::byte> bytes;
    bytes.reserve(state.motion.size() + state.contacts.size() + sounds.size() + state.books.size() * sizeof(transient::EnergyBook) + 4096);
    base::put(bytes, head);
    base::put_list(bytes, state.books);
    base::put_list(bytes, state.motion);
    base::put_list(bytes, state.contacts);
    base::put_list(bytes, sizes);
    base::put_list(bytes, sounds);
    base::put(bytes, calc_seal(bytes));
    base::write_file(file, view(bytes));
  });
}

std::optional<SimulationState> load_checkpoint(const comm::Communicator& comm, const std::filesystem::path& file, const Hash& identity) {
  Content content;
  const bool is_there = comm.broadcast([&] {
    if (file.empty() || !std::filesystem::exists(file)) return std::int32_t{0};
    content = read(file, identity, comm.size());
    return std::int32_t{1};
  }) != 0;
  if (!is_there) return std::nullopt;
  content.state.books = comm.broadcast(std::move(content.state.books));
  // Rank 0 sends each rank its part.
  comm::ByRank<std::byte> parts;
  parts.items = std::move(content.sounds);
  parts.begin.assign(1, 0);
  for (int r = 0; r < comm.size(); ++r) parts.begin.push_back(parts.begin.back() + (content.sizes.empty() ? 0 : content.sizes[r]));
  content.state.sound = comm::all_to_all(comm, parts).items;
  return std::move(content.state);
}

}  // namespace carillon::simulation
