// Assignment problem, by shortest augmenting paths.
// Source: Kuhn 1955; Jonker and Volgenant 1987.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

namespace carillon::exchange {

/// Column of each row, with the least sum of costs; rows <= columns. `cost`: (rows, columns).
inline std::vector<std::size_t> assign(const std::vector<double>& cost, std::size_t rows, std::size_t columns) {
  constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  std::vector<double> row_price(rows + 1, 0.0), column_price(columns + 1, 0.0);
  std::vector<std::size_t> row_of(columns + 1, kNone), before(columns + 1, columns);
  for (std::size_t row = 0; row < rows; ++row) {
    std::size_t column = columns;  // an extra one, from which the path begins
    row_of[column] = row;
    std::vector<double> least(columns, std::numeric_limits<double>::infinity());
    std::vector<char> is_done(columns + 1, 0);
    do {
      is_done[column] = 1;
      const std::size_t at = row_of[column];
      std::size_t next = columns;
      double step = std::numeric_limits<double>::infinity();
      for (std::size_t c = 0; c < columns; ++c) {
        if (is_done[c] != 0) continue;
        const double reduced = cost[at * columns + c] - row_price[at] - column_price[c];
        if (reduced < least[c]) {
          least[c] = reduced;
          before[c] = column;
        }
        if (least[c] < step) {
          step = least[c];
          next = c;
        }
      }
      for (std::size_t c = 0; c <= columns; ++c) {
        if (is_done[c] != 0) {
          row_price[row_of[c]] += step;
          column_price[c] -= step;
        } else if (c < columns) {
          least[c] -= step;
        }
      }
      column = next;
    } while (row_of[column] != kNone);
    while (column != columns) {
      row_of[column] = row_of[before[column]];
      column = before[column];
    }
  }
  std::vector<std::size_t> column_of(rows, kNone);
  for (std::size_t c = 0; c < columns; ++c)
    if (row_of[c] != kNone) column_of[row_of[c]] = c;
  return column_of;
}

}  // namespace carillon::exchange
