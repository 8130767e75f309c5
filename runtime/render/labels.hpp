// Labels of a rendered scene, for learning: hits, contacts, poses and modal energies.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/render/render.hpp"
#include "runtime/scene/events.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::render {

/// Columns of equal length. Times are seconds of the scene; frames of the WAV file are time times rate, without latency.
struct LabelTable {
  struct Column {
    std::string name;
    std::size_t width = 0;  // numbers per row; 0: one, without a dimension
    std::variant<std::vector<double>, std::vector<std::int64_t>, std::vector<std::uint64_t>> values;
  };
  std::string name;
  std::vector<Column> columns;
};

struct Labels {
  int rate_hz = 0;
  std::uint64_t frames = 0;
  std::vector<std::string> bodies;
  /// "hit": one per blow on a body, of its middle; "contact": one per lasting contact; "touch": the records of contacts; "pose";
  /// "energy" of the modes.
  std::vector<LabelTable> tables;
};

/// `banks` as in calc_sound(). Memory grows with the number of events.
Labels make_labels(const scene::Scene& scene, const std::vector<const bank::Bank*>& banks, const scene::Events& events,
                   const ModalEnergies& energies);

/// Arrays "TABLE.COLUMN", and "rate_hz", "frames", "bodies" (UTF-8). Throws as NpzWriter.
void write_npz(const Labels& labels, const std::function<void(std::string_view)>& sink);

/// JSON lines: {"carillon_labels": 1, ...} first, then {"TABLE": {"COLUMN": ...}} per row, table by table.
void write_jsonl(const Labels& labels, const std::function<void(std::string_view)>& sink);

}  // namespace carillon::render
