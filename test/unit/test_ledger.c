// SPDX-License-Identifier: MIT
// The assumption ledger: its diagram, walked through exhaustively, beside a model that keeps to the diagram.
#include <string.h>

#include "iwheel/private/ledger.h"
#include "unity.h"

#define POISON 0xA5

static iw_ledger_t ledger;

void setUp(void) {
    memset(&ledger, POISON, sizeof ledger);
    iw_ledger_init(&ledger);
}

void tearDown(void) {}

static void assert_entry(iw_ledger_item_t item, iw_ledger_state_t state, iw_evidence_t evidence, int32_t figure) {
    const iw_ledger_entry_t *entry = iw_ledger_entry(&ledger, item);
    TEST_ASSERT_EQUAL_INT(state, entry->state);
    TEST_ASSERT_EQUAL_INT(evidence, entry->evidence);
    TEST_ASSERT_EQUAL_INT32(figure, entry->figure);
}

static void test_init_assumes_everything_and_tells_what_the_document_says(void) {
    static const iw_evidence_t origin[IW_LEDGER_ITEMS] = {
        [IW_LEDGER_FORCE_UNIT_LEFT] = IW_EVIDENCE_DOCUMENT,
        [IW_LEDGER_FORCE_UNIT_RIGHT] = IW_EVIDENCE_DOCUMENT,
        [IW_LEDGER_OFFSET_INCLUDED] = IW_EVIDENCE_DOCUMENT,
        [IW_LEDGER_WHEEL_RADIUS] = IW_EVIDENCE_DOCUMENT,
    };
    for (int item = 0; item < IW_LEDGER_DLC; item++) {
        assert_entry((iw_ledger_item_t)item, IW_LEDGER_ASSUMED, origin[item], 0);
    }
    // The table shows the lengths and nothing states them: either reading of "documented" will do.
    TEST_ASSERT_EQUAL_INT(IW_LEDGER_ASSUMED, iw_ledger_entry(&ledger, IW_LEDGER_DLC)->state);
    TEST_ASSERT_EQUAL_INT32(0, iw_ledger_entry(&ledger, IW_LEDGER_DLC)->figure);
    TEST_ASSERT_EQUAL_UINT32(0, ledger.changes);
    TEST_ASSERT_EQUAL_INT(IW_LEDGER_ITEMS, ledger.doubt);
}

static void test_there_are_fourteen_items(void) {
    TEST_ASSERT_EQUAL_INT(14, IW_LEDGER_ITEMS);
}

static void test_assume_tells_where_an_assumption_comes_from(void) {
    iw_ledger_assume(&ledger, IW_LEDGER_SETPOINT_TYPE, IW_EVIDENCE_CONFIGURATION);
    assert_entry(IW_LEDGER_SETPOINT_TYPE, IW_LEDGER_ASSUMED, IW_EVIDENCE_CONFIGURATION, 0);
    TEST_ASSERT_EQUAL_UINT32(1, ledger.changes);
    iw_ledger_assume(&ledger, IW_LEDGER_SETPOINT_TYPE, IW_EVIDENCE_CONFIGURATION);
    TEST_ASSERT_EQUAL_UINT32(1, ledger.changes);
    iw_ledger_assume(&ledger, IW_LEDGER_SETPOINT_TYPE, IW_EVIDENCE_NONE);
    assert_entry(IW_LEDGER_SETPOINT_TYPE, IW_LEDGER_ASSUMED, IW_EVIDENCE_NONE, 0);
}

static void test_confirm_from_bus_lifts_no_contradiction(void) {
    iw_ledger_contradict(&ledger, IW_LEDGER_FORCE_UNIT_LEFT, IW_EVIDENCE_BUS, 1010);
    iw_ledger_confirm(&ledger, IW_LEDGER_FORCE_UNIT_LEFT, IW_EVIDENCE_BUS, 9980);
    assert_entry(IW_LEDGER_FORCE_UNIT_LEFT, IW_LEDGER_CONTRADICTED, IW_EVIDENCE_BUS, 1010);
    TEST_ASSERT_EQUAL_UINT32(1, ledger.changes);
}

static void test_confirm_by_operator_lifts_a_contradiction(void) {
    iw_ledger_contradict(&ledger, IW_LEDGER_FORCE_UNIT_LEFT, IW_EVIDENCE_BUS, 1010);
    iw_ledger_confirm(&ledger, IW_LEDGER_FORCE_UNIT_LEFT, IW_EVIDENCE_OPERATOR, 0);
    assert_entry(IW_LEDGER_FORCE_UNIT_LEFT, IW_LEDGER_CONFIRMED, IW_EVIDENCE_OPERATOR, 0);
    TEST_ASSERT_EQUAL_UINT32(2, ledger.changes);
}

static void test_confirm_from_bus_does_not_replace_the_operators_word(void) {
    iw_ledger_confirm(&ledger, IW_LEDGER_WHEEL_RADIUS, IW_EVIDENCE_OPERATOR, 0);
    iw_ledger_confirm(&ledger, IW_LEDGER_WHEEL_RADIUS, IW_EVIDENCE_BUS, 77);
    assert_entry(IW_LEDGER_WHEEL_RADIUS, IW_LEDGER_CONFIRMED, IW_EVIDENCE_OPERATOR, 0);
    TEST_ASSERT_EQUAL_UINT32(1, ledger.changes);
}

static void test_confirm_by_operator_replaces_evidence_of_the_bus(void) {
    iw_ledger_confirm(&ledger, IW_LEDGER_FEEDBACK_SIGN_LEFT, IW_EVIDENCE_BUS, 120);
    assert_entry(IW_LEDGER_FEEDBACK_SIGN_LEFT, IW_LEDGER_CONFIRMED, IW_EVIDENCE_BUS, 120);
    iw_ledger_confirm(&ledger, IW_LEDGER_FEEDBACK_SIGN_LEFT, IW_EVIDENCE_OPERATOR, 0);
    assert_entry(IW_LEDGER_FEEDBACK_SIGN_LEFT, IW_LEDGER_CONFIRMED, IW_EVIDENCE_OPERATOR, 0);
}

static void test_contradict_ends_every_confirmation_even_the_operators(void) {
    iw_ledger_confirm(&ledger, IW_LEDGER_FEEDBACK_SIGN_RIGHT, IW_EVIDENCE_OPERATOR, 0);
    iw_ledger_contradict(&ledger, IW_LEDGER_FEEDBACK_SIGN_RIGHT, IW_EVIDENCE_BUS, -120);
    assert_entry(IW_LEDGER_FEEDBACK_SIGN_RIGHT, IW_LEDGER_CONTRADICTED, IW_EVIDENCE_BUS, -120);
}

static void test_contradict_keeps_the_extremes_of_its_figure(void) {
    iw_ledger_contradict(&ledger, IW_LEDGER_DLC, IW_EVIDENCE_BUS, INT32_MIN);
    assert_entry(IW_LEDGER_DLC, IW_LEDGER_CONTRADICTED, IW_EVIDENCE_BUS, INT32_MIN);
    iw_ledger_confirm(&ledger, IW_LEDGER_DLC, IW_EVIDENCE_OPERATOR, INT32_MAX);
    assert_entry(IW_LEDGER_DLC, IW_LEDGER_CONFIRMED, IW_EVIDENCE_OPERATOR, INT32_MAX);
}

static void test_items_do_not_touch_each_other(void) {
    for (int touched = 0; touched < IW_LEDGER_ITEMS; touched++) {
        setUp();
        const iw_ledger_t before = ledger;
        iw_ledger_contradict(&ledger, (iw_ledger_item_t)touched, IW_EVIDENCE_BUS, 5);
        for (int item = 0; item < IW_LEDGER_ITEMS; item++) {
            const iw_ledger_entry_t *was = &before.entry[item];
            if (item != touched) {
                assert_entry((iw_ledger_item_t)item, was->state, was->evidence, was->figure);
            }
        }
        assert_entry((iw_ledger_item_t)touched, IW_LEDGER_CONTRADICTED, IW_EVIDENCE_BUS, 5);
    }
}

/// The operations of the walk: assume from two sources, confirm and contradict by bus and operator.
typedef enum {
    ASSUME_DOCUMENT,
    ASSUME_CONFIGURATION,
    CONFIRM_BUS,
    CONFIRM_OPERATOR,
    CONTRADICT_BUS,
    CONTRADICT_OPERATOR,
    OPERATIONS
} operation_t;

/// What the diagram and the two sentences under `confirm` make of it.
static iw_ledger_entry_t model(iw_ledger_entry_t entry, operation_t operation, int32_t figure) {
    const bool assumed = entry.state == IW_LEDGER_ASSUMED;
    const bool open_to_bus = assumed || (entry.state == IW_LEDGER_CONFIRMED && entry.evidence != IW_EVIDENCE_OPERATOR);
    const iw_ledger_entry_t results[OPERATIONS] = {
        [ASSUME_DOCUMENT] = {IW_LEDGER_ASSUMED, IW_EVIDENCE_DOCUMENT, 0},
        [ASSUME_CONFIGURATION] = {IW_LEDGER_ASSUMED, IW_EVIDENCE_CONFIGURATION, 0},
        [CONFIRM_BUS] = {IW_LEDGER_CONFIRMED, IW_EVIDENCE_BUS, figure},
        [CONFIRM_OPERATOR] = {IW_LEDGER_CONFIRMED, IW_EVIDENCE_OPERATOR, figure},
        [CONTRADICT_BUS] = {IW_LEDGER_CONTRADICTED, IW_EVIDENCE_BUS, figure},
        [CONTRADICT_OPERATOR] = {IW_LEDGER_CONTRADICTED, IW_EVIDENCE_OPERATOR, figure},
    };
    const bool ignored = (operation <= ASSUME_CONFIGURATION && !assumed) || (operation == CONFIRM_BUS && !open_to_bus);
    return ignored ? entry : results[operation];
}

static void apply(operation_t operation, int32_t figure) {
    const iw_ledger_item_t item = IW_LEDGER_GEAR_RATIO;
    if (operation <= ASSUME_CONFIGURATION) {
        iw_ledger_assume(&ledger, item,
                         (operation == ASSUME_DOCUMENT) ? IW_EVIDENCE_DOCUMENT : IW_EVIDENCE_CONFIGURATION);
    } else if (operation <= CONFIRM_OPERATOR) {
        iw_ledger_confirm(&ledger, item, (operation == CONFIRM_BUS) ? IW_EVIDENCE_BUS : IW_EVIDENCE_OPERATOR, figure);
    } else {
        iw_ledger_contradict(&ledger, item, (operation == CONTRADICT_BUS) ? IW_EVIDENCE_BUS : IW_EVIDENCE_OPERATOR,
                             figure);
    }
}

static bool differs(const iw_ledger_entry_t *a, const iw_ledger_entry_t *b) {
    return a->state != b->state || a->evidence != b->evidence || a->figure != b->figure;
}

static void walk(uint32_t path, unsigned length) {
    iw_ledger_entry_t expected = {IW_LEDGER_ASSUMED, IW_EVIDENCE_NONE, 0};
    setUp();
    for (unsigned i = 0; i < length; i++, path /= OPERATIONS) {
        const uint32_t changes = ledger.changes;
        const operation_t operation = (operation_t)(path % OPERATIONS);
        const int32_t figure = (int32_t)(i % 3);
        const iw_ledger_entry_t before = expected;
        expected = model(expected, operation, figure);
        apply(operation, figure);
        if (differs(&expected, iw_ledger_entry(&ledger, IW_LEDGER_GEAR_RATIO))) {
            assert_entry(IW_LEDGER_GEAR_RATIO, expected.state, expected.evidence, expected.figure);
        }
        if ((ledger.changes > changes) != differs(&before, &expected)) {
            TEST_FAIL_MESSAGE("changes must grow with every change and with nothing else");
        }
    }
}

static void test_every_sequence_of_six_operations_keeps_to_the_diagram(void) {
    for (uint32_t path = 0; path < 46656; path++) {
        walk(path, 6);
    }
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_init_assumes_everything_and_tells_what_the_document_says);
    RUN_TEST(test_there_are_fourteen_items);
    RUN_TEST(test_assume_tells_where_an_assumption_comes_from);
    RUN_TEST(test_confirm_from_bus_lifts_no_contradiction);
    RUN_TEST(test_confirm_by_operator_lifts_a_contradiction);
    RUN_TEST(test_confirm_from_bus_does_not_replace_the_operators_word);
    RUN_TEST(test_confirm_by_operator_replaces_evidence_of_the_bus);
    RUN_TEST(test_contradict_ends_every_confirmation_even_the_operators);
    RUN_TEST(test_contradict_keeps_the_extremes_of_its_figure);
    RUN_TEST(test_items_do_not_touch_each_other);
    RUN_TEST(test_every_sequence_of_six_operations_keeps_to_the_diagram);
    return UNITY_END();
}
