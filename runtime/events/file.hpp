// Contacts files: events of a scene for playback without physics. Reference: docs/howto/contacts-file.md.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/events/events.hpp"

namespace carillon::events {

/// Fingerprint of a surface in mesh axes [m]: extent along each axis, and the mean of the triangle centroids weighted by index + 1, which
/// depends on the numbering.
struct SurfaceMark {
  Vec3 size_m{};
  Vec3 order_m{};
};

/// Requires a vertex [m], a triangle and valid corners.
SurfaceMark mark_surface(std::span<const Vec3> vertices_m, std::span<const std::array<std::int32_t, 3>> triangles);

/// True if two marks agree to 1e-6 of the size.
bool is_same_surface(const SurfaceMark& a, const SurfaceMark& b);

struct RecordedBody {
  std::string name;
  std::int64_t triangles = 0;               // triangles of its bank
  std::optional<SurfaceMark> surface = {};  // missing in older and foreign files
};

struct Recording {
  std::vector<RecordedBody> bodies;  // events refer to them by index
  std::vector<Event> events;
};

/// Header line for `events` events; line of an event. Both end with a newline.
std::string format_header(const std::vector<RecordedBody>& bodies, std::uint64_t events);
void append_line(std::string& text, const Event& event);

/// Text of a contacts file; numbers read back bit by bit. Events must be valid (find_fault).
std::string format_recording(const Recording& recording);

/// Parses a contacts file; `file` names it in messages. Throws InputError "file:line: ..." for all that cannot be played: invalid JSON,
/// unknown or missing keys, invalid numbers, unknown bodies or triangles, events refused by find_fault, time that goes back by more than a
/// second, a number of events other than stated.
Recording parse_recording(std::string_view text, const std::filesystem::path& file);

/// Streams a file of any length event by event in file order, one line in memory. Returns the bodies, which are passed to `begin` (may be
/// empty) before the first event.
std::vector<RecordedBody> read_recording(const std::filesystem::path& file, const std::function<void(const Event&)>& sink,
                                         const std::function<void(const std::vector<RecordedBody>&)>& begin = {});

}  // namespace carillon::events
