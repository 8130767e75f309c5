// The banks of a page: small enough to be fetched, with the data of each that the page needs before it is loaded.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "jobs/front/explore/explore.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::explore {

struct BankFacts {
  PageBank kept;
  Vec3 low_m{}, high_m{};        // of the surface, in the frame of the mesh
  std::string material, group;   // the name of the table that it has or is nearest to, and its group
  Vec3 loudest_m{};              // the vertex where a blow is loudest
  std::array<int, 2> loudest{};  // the same place: a triangle, and which of its corners
};

/// Puts banks into a folder, each once. Large ones are packed; their triangles keep the numbers that recorded contacts name.
class PageBanks {
 public:
  /// keeps_all: they are copied as they are.
  PageBanks(std::filesystem::path folder, bool keeps_all) : folder_(std::move(folder)), keeps_all_(keeps_all) {}

  /// Throws InputError for files that are no whole bank or have no modes.
  const BankFacts& add(const std::filesystem::path& file);
  /// In the order in which they were added.
  std::vector<PageBank> list() const;

 private:
  std::filesystem::path folder_;
  bool keeps_all_;
  std::map<std::filesystem::path, BankFacts> facts_;
  std::vector<const BankFacts*> order_;
};

}  // namespace carillon::explore
