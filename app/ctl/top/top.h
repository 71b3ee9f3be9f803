// SPDX-License-Identifier: MIT
/// Live screen of `top`, drawn from the last snapshot, on any terminal.
///
/// 80 x 24 show everything, with the state in letters that can be read from a distance. Smaller terminals lose the least
/// important parts first, and narrow ones have shorter lines; below 20 x 4 only the state is drawn. Larger terminals also
/// show the last minute. Texts of other programs are cleaned before they are drawn.
#ifndef TOP_H
#define TOP_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

#define TOP_TEXT_SIZE 512U

typedef enum { TOP_PLAIN = 0, TOP_TITLE, TOP_GOOD, TOP_CARE, TOP_BAD, TOP_FAINT, TOP_TONES } top_tone_t;

/// Plots: speed left and right, force left and right.
#define TOP_PLOTS      4
#define TOP_HISTORY_US 100000
#define TOP_HISTORY    600

/// Values of the last minute, one each 100 ms; the newest is at `slot % TOP_HISTORY`. It begins as zeros.
typedef struct {
    int64_t slot;
    int32_t value[TOP_PLOTS][TOP_HISTORY]; ///< INT32_MIN: not known.
} top_history_t;

/// Stores the values of the snapshot; with a null pointer, stores that they are not known.
void top_history_take(top_history_t *self, int64_t now_us, const json_t *state);

/// From this width on lines are not shortened.
#define TOP_COLUMNS_WHOLE 72

/// Data of the screen.
typedef struct {
    json_t *state; ///< Last snapshot; NULL if there is none.
    char last_stop[TOP_TEXT_SIZE];
    char notice[TOP_TEXT_SIZE]; ///< Answer to the last key, or the reason why there is no gateway.
    bool connected;
    bool stale;                   ///< Connected, but no data arrived for a while.
    int scale_mm_s;               ///< Scale of the bars.
    bool colour;                  ///< Otherwise tones are only bold, reverse and dim.
    bool fine_blocks;             ///< The terminal shows UTF-8.
    const top_history_t *history; ///< NULL: none.
} top_model_t;

/// Draws the whole screen with ncurses, which must be running. Does not refresh it.
void top_draw(const top_model_t *model);

/// Draws formatted text at a place, cut at the right margin.
__attribute__((format(printf, 5, 6))) void top_put(const top_model_t *model, int row, int column, top_tone_t tone,
                                                   const char *format, ...);

/// Draws a word in letters of five rows; each letter has 6 columns. Unknown letters are not drawn.
void top_put_big(const top_model_t *model, int row, top_tone_t tone, const char *word);

/// Draws text, broken between words, in at most `rows` rows; the last one is cut. Returns the number of rows.
int top_put_wrapped(const top_model_t *model, int row, int rows, top_tone_t tone, const char *text);

/// Draws both wheels; `brief` leaves out their numbers. Returns the number of rows.
int top_draw_wheels(const top_model_t *model, int row, bool brief);

/// Draws bus, gaps, assumptions and warnings, as far as `rows` allow. Returns the number of rows.
int top_draw_rest(const top_model_t *model, int row, int rows);

/// Draws the last minute if `rows` are enough for it.
void top_draw_plots(const top_model_t *model, int row, int rows);

/// Returns the scale that shows the speeds: a round number, never smaller than the one before.
int top_scale(int before_mm_s, const json_t *state);

#endif
