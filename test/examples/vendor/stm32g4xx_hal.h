// SPDX-License-Identifier: MIT
// Only what examples/hal uses, after the documentation of ST's HAL and CMSIS. The real headers have more and other values.
#ifndef STM32G4XX_HAL_H
#define STM32G4XX_HAL_H

#include <stdint.h>

typedef enum { HAL_OK, HAL_ERROR } HAL_StatusTypeDef;
typedef enum { DISABLE, ENABLE } FunctionalState;
typedef enum { GPIO_PIN_RESET, GPIO_PIN_SET } GPIO_PinState;

typedef struct {
    volatile uint32_t CCCR;
    volatile uint32_t TXBRP;
    volatile uint32_t TXBAR;
} FDCAN_GlobalTypeDef;

typedef struct {
    uint32_t ClockDivider;
    uint32_t FrameFormat;
    uint32_t Mode;
    FunctionalState AutoRetransmission;
    FunctionalState TransmitPause;
    FunctionalState ProtocolException;
    uint32_t NominalPrescaler;
    uint32_t NominalSyncJumpWidth;
    uint32_t NominalTimeSeg1;
    uint32_t NominalTimeSeg2;
    uint32_t TxFifoQueueMode;
} FDCAN_InitTypeDef;

typedef struct {
    FDCAN_GlobalTypeDef *Instance;
    FDCAN_InitTypeDef Init;
} FDCAN_HandleTypeDef;

typedef struct {
    uint32_t Identifier;
    uint32_t IdType;
    uint32_t TxFrameType;
    uint32_t DataLength;
    uint32_t ErrorStateIndicator;
    uint32_t BitRateSwitch;
    uint32_t FDFormat;
    uint32_t TxEventFifoControl;
    uint32_t MessageMarker;
} FDCAN_TxHeaderTypeDef;

typedef struct {
    uint32_t Identifier;
    uint32_t IdType;
    uint32_t RxFrameType;
    uint32_t DataLength;
    uint32_t RxTimestamp;
} FDCAN_RxHeaderTypeDef;

typedef struct {
    uint32_t Identifier;
    uint32_t TxTimestamp;
    uint32_t MessageMarker;
} FDCAN_TxEventFifoTypeDef;

typedef struct {
    uint32_t ErrorPassive;
    uint32_t BusOff;
} FDCAN_ProtocolStatusTypeDef;

typedef struct {
    uint32_t counter;
} TIM_HandleTypeDef;

typedef struct {
    uint32_t IDR;
} GPIO_TypeDef;

#define FDCAN_CCCR_INIT                0x1U
#define FDCAN_CLOCK_DIV1               0U
#define FDCAN_FRAME_CLASSIC            0U
#define FDCAN_MODE_NORMAL              0U
#define FDCAN_TX_QUEUE_OPERATION       0x01000000U
#define FDCAN_ACCEPT_IN_RX_FIFO0       0U
#define FDCAN_FILTER_REMOTE            0U
#define FDCAN_TIMESTAMP_PRESC_1        0U
#define FDCAN_TIMESTAMP_INTERNAL       1U
#define FDCAN_IT_RX_FIFO0_NEW_MESSAGE  0x01U
#define FDCAN_IT_RX_FIFO0_MESSAGE_LOST 0x04U
#define FDCAN_IT_TX_EVT_FIFO_NEW_DATA  0x0400U
#define FDCAN_IT_TX_EVT_FIFO_ELT_LOST  0x1000U
#define FDCAN_STANDARD_ID              0U
#define FDCAN_EXTENDED_ID              0x40000000U
#define FDCAN_DATA_FRAME               0U
#define FDCAN_REMOTE_FRAME             0x20000000U
#define FDCAN_DLC_BYTES_1              0x1U
#define FDCAN_ESI_ACTIVE               0U
#define FDCAN_BRS_OFF                  0U
#define FDCAN_CLASSIC_CAN              0U
#define FDCAN_STORE_TX_EVENTS          0x00800000U
#define FDCAN_RX_FIFO0                 0x40U
#define FDCAN_TX_BUFFER0               0x1U
#define FDCAN_TX_BUFFER1               0x2U
#define FDCAN_TX_BUFFER2               0x4U

#define __HAL_TIM_GET_COUNTER(timer) ((timer)->counter)

extern uint32_t SystemCoreClock;

uint32_t __get_PRIMASK(void);
void __set_PRIMASK(uint32_t masked);
void __disable_irq(void);
GPIO_PinState HAL_GPIO_ReadPin(GPIO_TypeDef *port, uint16_t pin);
void HAL_GPIO_EXTI_Callback(uint16_t pin);

HAL_StatusTypeDef HAL_FDCAN_Init(FDCAN_HandleTypeDef *controller);
HAL_StatusTypeDef HAL_FDCAN_ConfigGlobalFilter(FDCAN_HandleTypeDef *controller, uint32_t standard, uint32_t extended,
                                               uint32_t remote_standard, uint32_t remote_extended);
HAL_StatusTypeDef HAL_FDCAN_ConfigTimestampCounter(FDCAN_HandleTypeDef *controller, uint32_t prescaler);
HAL_StatusTypeDef HAL_FDCAN_EnableTimestampCounter(FDCAN_HandleTypeDef *controller, uint32_t operation);
HAL_StatusTypeDef HAL_FDCAN_ActivateNotification(FDCAN_HandleTypeDef *controller, uint32_t interrupts,
                                                 uint32_t buffers);
HAL_StatusTypeDef HAL_FDCAN_Start(FDCAN_HandleTypeDef *controller);
HAL_StatusTypeDef HAL_FDCAN_Stop(FDCAN_HandleTypeDef *controller);
HAL_StatusTypeDef HAL_FDCAN_AddMessageToTxFifoQ(FDCAN_HandleTypeDef *controller, const FDCAN_TxHeaderTypeDef *header,
                                                const uint8_t *data);
uint32_t HAL_FDCAN_GetLatestTxFifoQRequestBuffer(const FDCAN_HandleTypeDef *controller);
HAL_StatusTypeDef HAL_FDCAN_AbortTxRequest(FDCAN_HandleTypeDef *controller, uint32_t buffers);
uint32_t HAL_FDCAN_GetRxFifoFillLevel(const FDCAN_HandleTypeDef *controller, uint32_t fifo);
HAL_StatusTypeDef HAL_FDCAN_GetRxMessage(FDCAN_HandleTypeDef *controller, uint32_t fifo, FDCAN_RxHeaderTypeDef *header,
                                         uint8_t *data);
HAL_StatusTypeDef HAL_FDCAN_GetTxEvent(FDCAN_HandleTypeDef *controller, FDCAN_TxEventFifoTypeDef *event);
HAL_StatusTypeDef HAL_FDCAN_GetProtocolStatus(const FDCAN_HandleTypeDef *controller,
                                              FDCAN_ProtocolStatusTypeDef *status);
void HAL_FDCAN_RxFifo0Callback(FDCAN_HandleTypeDef *controller, uint32_t interrupts);
void HAL_FDCAN_TxEventFifoCallback(FDCAN_HandleTypeDef *controller, uint32_t interrupts);

#endif
