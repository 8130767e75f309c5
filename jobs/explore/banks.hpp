// The banks of a page: small enough to be fetched, with what the page wants to know of each before it has it.
#pragma once

#include <json/json.h>

#include <array>
#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "jobs/explore/explore.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::explore {

struct BankFacts {
  PackedBank packed;
  Vec3 low_m{}, high_m{};        // of the surface, in the frame of the mesh
  std::string material, group;   // the name of the table that it has or is nearest to, and its group
  Vec3 loudest_m{};              // the vertex where a blow is heard most
  std::array<int, 2> loudest{};  // the same place: a triangle, and which of its corners
};

/// Puts banks into a folder, each once. Large ones keep the modes that are heard and coarser shapes.
class Banks {
 public:
  /// keeps_all: they are copied as they are.
  Banks(std::filesystem::path folder, bool keeps_all) : folder_(std::move(folder)), keeps_all_(keeps_all) {}

  /// Throws InputError for what is no whole bank or has no modes.
  const BankFacts& add(const std::filesystem::path& file);
  /// In the order in which they were added.
  std::vector<PackedBank> list() const;

 private:
  std::filesystem::path folder_;
  bool keeps_all_;
  std::map<std::filesystem::path, BankFacts> facts_;
  std::vector<const BankFacts*> order_;
};

}  // namespace carillon::explore
