// Tile-by-tile factorisation of fronts shared by several ranks.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "precompute/ldlt/mailbox.hpp"
#include "precompute/ldlt/numeric.hpp"
#include "precompute/ldlt/plan.hpp"

namespace carillon::ldlt {

/// Tag of the letters, and of those of the next factorisation this + 1: a rank may be one ahead.
inline constexpr int kLetterTag = 64;

/// Factorises this rank's tiles of shared fronts. Never waits for a particular message: among the fronts with complete children it takes
/// the first possible step in the order of the plan. Each tile is updated panel by panel, and children are added in order, so the result
/// does not depend on message timing.
class SharedFactoriser {
 public:
  /// blocks: entries of A received, as listed in plan.received. All arguments must outlive it.
  SharedFactoriser(const Plan& plan, Numbers& numbers, const std::vector<std::vector<double>>& blocks);

  /// Factorises the own fronts, then the shared ones, and combines the outcome of all ranks. Collective. Throws SystemError on all ranks if
  /// memory runs out on one, after all messages have been received.
  void run(const std::function<void()>& factorise_own);

  /// Address of the first row of node a in column c of a contribution block; rows of nodes in the same tile follow.
  using FindRows = std::function<const double*(std::int32_t a, std::int64_t c)>;

  /// Sends the part of place `from` of the contribution block of a child of shared front `parent`, also to this rank itself.
  void send_update(std::int32_t parent, std::int32_t child, int from, const FindRows& find);

 private:
  /// A panel while it is applied to the tiles of this rank.
  struct Update {
    std::shared_ptr<const Letter> letter;        // W of a whole column as sent, or
    Buffer rows;                                 // W of this rank's rows behind the panel, in strips,
    Buffer columns;                              // and of its columns that are not among its rows
    const double* wide = nullptr;                // W of the rows, in either case
    Buffer tiles;                                // L of its columns computed here
    std::vector<const double*> tiles_of_column;  // (column tiles) L of each, once complete
    BlockPivots pivots;
    int missing = 0;  // ranks whose rows have not arrived
    bool is_ready = false;
  };
  /// Working state of a front.
  struct Work {
    std::vector<std::vector<Letter>> children;  // (children) of (places): letters received
    int missing = 0;                            // letters of children not yet received
    bool is_assembled = false;
    bool is_done = false;
    std::vector<Buffer> tiles;        // behind the pivots, by tile columns, each of full height
    std::vector<double*> columns;     // (column tiles) begin of each: pivot columns in the memory of the panels, others in `tiles`
    int lead = 0;                     // next panel to eliminate
    int panel = 0;                    // panel currently applied to the tiles
    std::size_t next = 0;             // next column to update by it, index in column_tiles
    std::map<int, Update> updates;    // by panel
    std::map<int, Letter> diagonals;  // by panel: L11^-1 and D from other ranks
  };

  void work_off();
  void drain();
  void take(Letter letter);
  void take_panel(std::int32_t f, Letter letter);
  bool step(std::int32_t f);
  bool eliminate_lead(const SharedFront& front, Work& work, std::int32_t f);
  bool update_next(const SharedFront& front, Work& work);
  void assemble(const SharedFront& front, Work& work, std::int32_t f);
  /// find_rows(piece, c): address of the first row of column c.
  template <typename FindPieceRows>
  void add_update(const SharedFront& front, Work& work, const SharedChild& child, int from, FindPieceRows&& find_rows);
  void finish(const SharedFront& front, Work& work);
  void eliminate_diagonal(const SharedFront& front, Work& work, std::int32_t f, int k);
  void eliminate_column(const SharedFront& front, Work& work, std::int32_t f, int k, const BlockPivots& pivots, const double* triangle);
  Update& find_update(const SharedFront& front, Work& work, int k);
  void add_rows(const SharedFront& front, Update& update, int k, int from, const double* rows);
  void send_rows(const SharedFront& front, int k, const BlockPivots& pivots, const std::shared_ptr<const Letter>& letter,
                 const double* wide);
  void complete(const SharedFront& front, std::int32_t f, Update& update, int k);

  /// Address of row 0 of this rank's rows of the front, in one column of a tile column.
  static double* find_column(const SharedFront& front, const Work& work, std::size_t at, std::int32_t column);
  static int find_first_row(const SharedFront& front, int k) { return 3 * front.row_begin[k]; }

  const Plan& plan_;
  Numbers& numbers_;
  const std::vector<std::vector<double>>& blocks_;
  const FactorKernels& kernels_;
  Mailbox mailbox_;
  std::vector<Work> works_;
  std::map<std::int32_t, std::int32_t> shared_of_id_;
  Buffer block_;
  int left_ = 0;  // unfinished fronts
  bool has_failed_ = false;
};

}  // namespace carillon::ldlt
