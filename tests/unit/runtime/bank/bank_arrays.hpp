// Arrays and bytes of banks, for tests that modify them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "runtime/bank/layout.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"

namespace carillon::bank {

inline std::span<const std::byte> bytes_of(std::string_view text) { return std::as_bytes(std::span(text)); }

/// Modifiable arrays of a bank.
struct Arrays {
  Bank bank;
  FileForm form;
  std::vector<FieldBytes> list;

  Arrays(const Arrays&) = delete;  // the list points into the bank
  explicit Arrays(Bank of) : bank(std::move(of)), form(make_file_form(bank)) {
    for (const Field& field : list_fields(bank, form))
      list.push_back({field, {static_cast<const std::byte*>(field.data), calc_bytes(field)}});
  }
  FieldBytes& find(const std::string& name) {
    return *std::find_if(list.begin(), list.end(), [&](const FieldBytes& array) { return array.field.name == name; });
  }
  /// Error message, or "".
  std::string find_error() const {
    return tests::catch_message<InputError>([&] { (void)assemble_bank(list, "arrays"); });
  }
};

}  // namespace carillon::bank
