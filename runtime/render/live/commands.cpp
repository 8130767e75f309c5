#include "runtime/render/live/commands.hpp"

#include <fmt/core.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <span>

#include "runtime/base/document.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/render/stage.hpp"

namespace carillon::live {
namespace {

constexpr std::size_t kMaxLine = 100000;

double read_number(const std::string& word) {
  double value = 0.0;
  const char* const end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data(), end, value);
  if (error != std::errc() || stop != end || !std::isfinite(value))
    throw InputError(fmt::format("\"{}\" is no number", base::printable(word)));
  return value;
}

using Numbers = std::vector<double>;

Vec3 take_vector(const Numbers& n, std::size_t first) { return {n[first], n[first + 1], n[first + 2]}; }

struct Command {
  const char* form;                  // of its numbers
  std::array<std::size_t, 2> sizes;  // permitted numbers of them
  std::string (*act)(physics::World& world, int body, const std::string& name, const Numbers& n);
};

std::string push(physics::World& world, int body, const std::string&, const Numbers& n) {
  world.push(body, n.size() == 6 ? take_vector(n, 3) : world.get_centre(body), take_vector(n, 0));
  return {};
}

std::string grab(physics::World& world, int body, const std::string&, const Numbers& n) {
  world.grab(body, n.size() == 3 ? take_vector(n, 0) : world.get_centre(body));
  return {};
}

std::string drag(physics::World& world, int body, const std::string&, const Numbers& n) {
  if (n.size() == 4)
    world.drag(body, take_vector(n, 0), n[3]);
  else
    world.drag(body, take_vector(n, 0));
  return {};
}

std::string release(physics::World& world, int body, const std::string&, const Numbers&) {
  world.release(body);
  return {};
}

/// The attitude stays that of the body when it left the world.
std::string add(physics::World& world, int body, const std::string&, const Numbers& n) {
  physics::Entry entry{.pose = world.get_pose(body)};
  entry.pose.position_m = take_vector(n, 0);
  if (n.size() == 6) entry.velocity_m_s = take_vector(n, 3);
  world.add(body, entry);
  return {};
}

std::string remove(physics::World& world, int body, const std::string&, const Numbers&) {
  world.remove(body);
  return {};
}

std::string show(physics::World& world, int body, const std::string& name, const Numbers&) {
  const Vec3 at = world.get_centre(body);
  return fmt::format("{} {:.6f} {:.6f} {:.6f}{}", base::printable(name), at[0], at[1], at[2], world.is_absent(body) ? " absent" : "");
}

const std::map<std::string, Command, std::less<>>& get_commands() {
  static const std::map<std::string, Command, std::less<>> commands{{"push", {"an impulse [N s], and perhaps a point [m]", {3, 6}, push}},
                                                                    {"grab", {"perhaps a point [m]", {0, 3}, grab}},
                                                                    {"drag", {"a point [m], and perhaps a time [s]", {3, 4}, drag}},
                                                                    {"release", {"nothing else", {0, 0}, release}},
                                                                    {"add", {"a position [m], and perhaps a velocity [m/s]", {3, 6}, add}},
                                                                    {"remove", {"nothing else", {0, 0}, remove}},
                                                                    {"where", {"nothing else", {0, 0}, show}}};
  return commands;
}

}  // namespace

const char* const kCommandText =
    "push NAME JX JY JZ [X Y Z]   impulse [N s] at a point [m], or at the centre of mass\n"
    "grab NAME [X Y Z]            hold the body at a point, or at its centre of mass\n"
    "drag NAME X Y Z [S]          move the held point there within S seconds, or 0.02\n"
    "release NAME                 let go\n"
    "remove NAME                  take the body out of the world\n"
    "add NAME X Y Z [VX VY VZ]    put it there again [m], with a velocity [m/s]\n"
    "add {\"name\": ..., ...}      a new body: JSON with the keys of a body in a scene file\n"
    "where NAME                   print the position of its centre of mass [m]\n"
    "quit                         end before the scene does\n";

std::vector<std::string> split(std::string_view line) {
  std::vector<std::string> words;
  if (line.starts_with('#')) return words;
  bool is_quoted = false, is_word = false;
  for (std::size_t n = 0; n < line.size(); ++n) {
    const char c = line[n];
    if (c == '{' && !is_quoted && !is_word) {
      words.emplace_back(line.substr(n));
      break;
    }
    if (c == '"') {
      is_quoted = !is_quoted;
      if (is_quoted) words.emplace_back();
      is_word = is_quoted;
    } else if (!is_quoted && (c == ' ' || c == '\t' || c == '\r')) {
      is_word = false;
    } else {
      if (!is_word) words.emplace_back();
      is_word = true;
      words.back() += c;
    }
  }
  if (is_quoted) throw InputError("a name has a double quote at its start only; close it");
  return words;
}

std::string carry_out(const std::vector<std::string>& words, Hands& hands) {
  if (words.empty()) return {};
  const auto found = get_commands().find(words[0]);
  if (found == get_commands().end()) {
    std::vector<std::string> known{"quit"};
    for (const auto& [word, command] : get_commands()) known.push_back(word);
    if (words[0] == "quit") throw InputError("quit has no other words; give it alone");
    const std::string nearest = base::find_nearest(words[0], known);
    throw InputError(fmt::format("there is no command \"{}\"{}", base::printable(words[0]),
                                 nearest.empty() ? "; carillon-live --help lists them" : fmt::format("; did you mean \"{}\"?", nearest)));
  }
  if (hands.world == nullptr) throw InputError("no body of the scene can move");
  if (words[0] == "add" && words.size() == 2 && words[1].starts_with('{')) {
    hands.names.push_back(hands.make(words[1]));
    return {};
  }
  const Command& command = found->second;
  if (words.size() < 2) throw InputError(fmt::format("{} needs the name of a body", words[0]));
  const int body = render::find_body(hands.names, words[1]);
  Numbers numbers;
  for (std::size_t k = 2; k < words.size(); ++k) numbers.push_back(read_number(words[k]));
  if (std::find(command.sizes.begin(), command.sizes.end(), numbers.size()) == command.sizes.end())
    throw InputError(fmt::format("{} has {} numbers after the name; give {}", words[0], numbers.size(), command.form));
  return command.act(*hands.world, body, words[1], numbers);
}

std::vector<std::string> LineReader::read() {
  std::vector<std::string> lines;
  const auto finish = [&] {
    lines.push_back(begun_.substr(0, kMaxLine));
    begun_.clear();
  };
  pollfd source{descriptor_, POLLIN, 0};
  std::array<char, 4096> piece;
  if (!is_open_ || poll(&source, 1, 0) <= 0) return lines;
  const ssize_t count = ::read(descriptor_, piece.data(), piece.size());
  if (count <= 0) {
    is_open_ = false;
    if (!begun_.empty()) finish();
    return lines;
  }
  for (const char c : std::span(piece.data(), static_cast<std::size_t>(count)))
    if (c == '\n')
      finish();
    else if (begun_.size() <= kMaxLine)
      begun_ += c;
  return lines;
}

}  // namespace carillon::live
