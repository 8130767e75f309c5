// Banks of a page: packed if large, with the data that the page needs before loading them.
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "jobs/front/explore/explore.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::explore {

struct BankFacts {
  PageBank kept;
  Vec3 low_m{}, high_m{};        // bounding box of the surface, in the frame of the mesh
  std::string material, group;   // nearest row of the material table, and its group
  Vec3 loudest_m{};              // vertex with the loudest response
  std::array<int, 2> loudest{};  // the same vertex as triangle and corner
};

/// Puts banks into a folder, each once. Large ones are packed without renumbering triangles, which recorded contacts refer to.
class PageBanks {
 public:
  /// `keeps_all`: copies all banks unchanged.
  PageBanks(std::filesystem::path folder, bool keeps_all) : folder_(std::move(folder)), keeps_all_(keeps_all) {}

  /// InputError for invalid banks and banks without modes.
  const BankFacts& add(const std::filesystem::path& file);
  /// In the order of add().
  std::vector<PageBank> list() const;

 private:
  std::filesystem::path folder_;
  bool keeps_all_;
  std::map<std::filesystem::path, BankFacts> facts_;
  std::vector<const BankFacts*> order_;
};

}  // namespace carillon::explore
