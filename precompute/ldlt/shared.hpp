// Fronts that several ranks share, factorised tile by tile.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "precompute/ldlt/mailbox.hpp"
#include "precompute/ldlt/numeric.hpp"
#include "precompute/ldlt/plan.hpp"

namespace carillon::ldlt {

/// Factorises this rank's tiles of shared fronts. It never waits for one message: of the fronts whose children are complete it takes the
/// next step that can be taken, in the order of the plan. Each tile is updated by one panel after the other, and children are added in
/// order, so the result does not depend on which message came first.
class SharedFactoriser {
 public:
  /// blocks: what came of A, as plan.received lists it. Both must outlive it.
  SharedFactoriser(const Plan& plan, Numbers& numbers, const std::vector<std::vector<double>>& blocks);

  /// Does the own fronts, then the shared ones, and makes the outcome that of all ranks. Collective. Throws SystemError on all ranks when
  /// memory runs out on one, after all messages have been taken.
  void run(const std::function<void()>& factorise_own);

  /// Where the first row of node a is in column c of an update matrix; the rows of nodes in the same tile follow.
  using FindRows = std::function<const double*(std::int32_t a, std::int64_t c)>;

  /// Sends what place `from` has of the update matrix of a child of shared front `parent`, to this rank itself, too.
  void send_update(std::int32_t parent, std::int32_t child, int from, const FindRows& find);

 private:
  /// A panel on its way through the tiles of this rank.
  struct Update {
    std::shared_ptr<const Letter> letter;        // W of a whole column as it was sent, or
    Buffer rows;                                 // W of the rows of this rank behind the panel, in strips,
    Buffer columns;                              // and of those of its columns that are not among its rows
    const double* wide = nullptr;                // W of the rows, either way
    Buffer tiles;                                // L of its columns that it has not made itself
    std::vector<const double*> tiles_of_column;  // (column tiles) L of each, once all is there
    BlockPivots pivots;
    int missing = 0;  // ranks whose rows have not come
    bool is_ready = false;
  };
  /// A front in work.
  struct Work {
    std::vector<std::vector<Letter>> children;  // (children) of (places): what has come
    int missing = 0;                            // letters of children
    bool is_assembled = false;
    bool is_done = false;
    std::vector<Buffer> tiles;        // behind the pivots, by columns of tiles, each column in full height
    std::vector<double*> columns;     // (column tiles) where each begins: those of pivots in the place of the panels, the rest in `tiles`
    int lead = 0;                     // the panel that is eliminated next
    int panel = 0;                    // the panel by which the tiles are updated
    std::size_t next = 0;             // the column that is updated next by it, among the column tiles
    std::map<int, Update> updates;    // by panel
    std::map<int, Letter> diagonals;  // by panel: L11^-1 and D of other ranks
  };

  void work_off();
  void drain();
  void take(Letter letter);
  void take_panel(std::int32_t f, Letter letter);
  bool step(std::int32_t f);
  bool eliminate_lead(const SharedFront& front, Work& work, std::int32_t f);
  bool update_next(const SharedFront& front, Work& work);
  void assemble(const SharedFront& front, Work& work, std::int32_t f);
  /// find_rows(piece, c): where the first row meant of column c is.
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

  /// Where row 0 of this rank's rows of the front would be in a column of a column of tiles.
  static double* find_column(const SharedFront& front, const Work& work, std::size_t at, std::int32_t column);
  static int find_first_row(const SharedFront& front, int k) { return 3 * front.row_begin[k]; }

  const Plan& plan_;
  Numbers& numbers_;
  const std::vector<std::vector<double>>& blocks_;
  const Kernels& kernels_;
  Mailbox mailbox_;
  std::vector<Work> works_;
  std::map<std::int32_t, std::int32_t> shared_of_id_;
  Buffer block_;
  int left_ = 0;  // fronts that are not done
  bool has_failed_ = false;
};

}  // namespace carillon::ldlt
