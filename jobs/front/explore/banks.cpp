#include "jobs/front/explore/banks.hpp"

#include <fmt/core.h>

#include <cctype>
#include <cmath>
#include <limits>
#include <set>

#include "jobs/front/explore/files.hpp"
#include "jobs/front/report/record.hpp"
#include "runtime/bank/bank.hpp"
#include "runtime/bank/blows.hpp"
#include "runtime/bank/pack.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/bank/write.hpp"
#include "runtime/material/table.hpp"

namespace carillon::explore {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kSmallBytes = 4'000'000;  // not packed below
constexpr double kPackErrorDb = -60.0;             // for larger ones

const material::Row* find_nearest(const material::MaterialTable& table, const bank::Material& material) {
  const material::Row* nearest = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const material::Row& row : table.rows()) {
    const double off = std::abs(std::log(row.material.young_modulus_pa / material.young_modulus_pa)) +
                       2.0 * std::abs(std::log(row.material.density_kg_m3 / material.density_kg_m3));
    if (off < least) least = off, nearest = &row;
  }
  return nearest;
}

/// The material for the look of the body: that of the job, else one in the file name ("shelf_wood"), else the table row with the nearest
/// stiffness and density.
void find_material(const bank::Bank& bank, const fs::path& file, BankFacts& facts) {
  const material::MaterialTable& table = material::MaterialTable::get();
  const base::Json job = report::parse_json(bank.provenance);
  const base::Json& given = job["material"];
  const material::Row* row = nullptr;
  if (given.is_string()) row = table.find(given.as_string());
  if (given.is_object() && given["name"].is_string()) row = table.find(given["name"].as_string());
  std::string word;
  for (const char c : file.stem().string() + " ") {
    if (std::isalpha(static_cast<unsigned char>(c)) != 0) {
      word += c;
      continue;
    }
    if (row == nullptr && !word.empty()) row = table.find(word);
    for (const material::Row& one : table.rows())
      if (row == nullptr && one.group == word) facts.group = word;
    word.clear();
  }
  if (row == nullptr && facts.group.empty()) row = find_nearest(table, bank.material);
  if (row == nullptr) return;
  facts.material = row->material.name;
  facts.group = row->group;
}

void find_place(const bank::Bank& bank, BankFacts& facts) {
  const auto [low, high] = bank::find_extent(bank.vertices_m);
  facts.low_m = low;
  facts.high_m = high;
  const std::size_t vertex = bank::find_strikes(bank, 1).front();
  facts.loudest_m = bank.vertices_m[vertex];
  for (std::size_t t = 0; t < bank.triangles.size(); ++t)
    for (int corner = 0; corner < 3; ++corner)
      if (static_cast<std::size_t>(bank.triangles[t][corner]) == vertex) {
        facts.loudest = {static_cast<int>(t), corner};
        return;
      }
}

}  // namespace

const BankFacts& PageBanks::add(const fs::path& file) {
  const fs::path whole = fs::weakly_canonical(file);
  if (const auto found = facts_.find(whole); found != facts_.end()) return found->second;
  const bank::Bank bank = bank::read_bank(file);
  if (bank.mode_count() == 0) throw InputError(fmt::format("{}: the bank has no modes, so it has no sound", file.string()));
  BankFacts facts;
  find_material(bank, file, facts);
  find_place(bank, facts);
  facts.kept.full_bytes = fs::file_size(file);
  std::set<std::string> taken;
  for (const BankFacts* other : order_) taken.insert(other->kept.name);
  const std::string stem = make_name(file.stem().string());
  facts.kept.name = stem + ".hdf";
  for (int k = 2; taken.contains(facts.kept.name); ++k) facts.kept.name = fmt::format("{}-{}.hdf", stem, k);
  const fs::path target = folder_ / facts.kept.name;
  if (keeps_all_ || bank.packing || facts.kept.full_bytes <= kSmallBytes) {
    put_file(file, target);
  } else {
    const bank::PackedBank packed = bank::calc_packed(bank, kPackErrorDb, true);
    bank::write_packed_bank(packed, target);
    facts.kept.change = "packed, " + bank::describe(*packed.bank.packing);
  }
  facts.kept.bytes = fs::file_size(target);
  const BankFacts& kept = facts_.emplace(whole, std::move(facts)).first->second;
  order_.push_back(&kept);
  return kept;
}

std::vector<PageBank> PageBanks::list() const {
  std::vector<PageBank> banks;
  for (const BankFacts* facts : order_) banks.push_back(facts->kept);
  return banks;
}

}  // namespace carillon::explore
