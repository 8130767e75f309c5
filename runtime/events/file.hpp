// Contacts files: the events of a scene, to be played without physics. Reference: docs/howto/contacts-file.md.
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

/// A fingerprint of a surface, in metres of the mesh: its extent along each axis, and the mean of its triangles' centroids,
/// triangle i weighted by i + 1, so that another numbering gives another place.
struct SurfaceMark {
  Vec3 size_m{};
  Vec3 order_m{};
};

/// Of at least one vertex [m] and triangle, whose corners are there.
SurfaceMark mark_surface(std::span<const Vec3> vertices_m, std::span<const std::array<std::int32_t, 3>> triangles);

/// Whether two marks are of one surface, to 1e-6 of its size.
bool is_same_surface(const SurfaceMark& a, const SurfaceMark& b);

struct RecordedBody {
  std::string name;
  std::int64_t triangles = 0;               // of its bank
  std::optional<SurfaceMark> surface = {};  // of its bank; files of others, and older ones, do not say
};

struct Recording {
  std::vector<RecordedBody> bodies;  // events name them by their number
  std::vector<Event> events;
};

/// The first line of a contacts file of so many events, and the line of one event, both with their end of line.
std::string format_header(const std::vector<RecordedBody>& bodies, std::uint64_t events);
void append_line(std::string& text, const Event& event);

/// The text of a contacts file. Every number is read back as the same bits. The events have no fault (find_fault).
std::string format_recording(const Recording& recording);

/// Reads the text of a contacts file; `file` names it in messages. Throws InputError "file:line: ..." for everything that could not be
/// played: no JSON, an unknown or missing key, a number that is none, a body or triangle that there is not, an event that find_fault
/// refuses, time that goes back by more than a second, fewer or more events than the first line says.
Recording parse_recording(std::string_view text, const std::filesystem::path& file);

/// The same from a file of any length, event by event in the order of the file: memory is that of one line. Returns the bodies, which
/// `begin` (may be empty) is given before the first event.
std::vector<RecordedBody> read_recording(const std::filesystem::path& file, const std::function<void(const Event&)>& sink,
                                         const std::function<void(const std::vector<RecordedBody>&)>& begin = {});

}  // namespace carillon::events
